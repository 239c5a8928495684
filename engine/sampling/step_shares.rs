//! Which mask steps see a rectangle, and how much of it.

use super::patch::Patch;
use super::response::Opening;

/// Mask steps that follow one another and see the same share of a rectangle. Narrow rectangles are
/// seen whole by nearly all steps that see them, of which there may be thousands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct StepRun {
    first: u32,
    count: u32,
    share: f32,
}

impl StepRun {
    /// The steps, each with the share that is open.
    pub(super) fn steps(&self) -> impl Iterator<Item = (u32, f32)> + use<> {
        let share = self.share;
        (self.first..self.first + self.count).map(move |step| (step, share))
    }
}

/// Appends a step, to the last run from `begin` on where it continues that.
fn push(out: &mut Vec<StepRun>, begin: usize, step: u32, share: f32) {
    match out[begin..].last_mut() {
        Some(run) if run.first + run.count == step && run.share.to_bits() == share.to_bits() => {
            run.count += 1;
        }
        _ => out.push(StepRun { first: step, count: 1, share }),
    }
}

/// Appends the steps whose openings show a part of a rectangle. `openings`: of its beamlet, by step.
pub(super) fn step_runs(patch: &Patch, leaf: u32, openings: &[Opening], out: &mut Vec<StepRun>) {
    let node = &patch.nodes[leaf as usize];
    let width = node.width();
    let middle = patch.shear * (node.centre()[1] - 0.5);
    let slant = patch.shear * node.height();
    let heights: &[f32] =
        if slant.abs() > 0.1 * width { &[-1.0 / 3.0, 0.0, 1.0 / 3.0] } else { &[0.0] };
    let begin = out.len();
    let mut seen: Option<(u32, f32)> = None;
    for opening in openings {
        let at = |height: &f32| {
            let x = node.x.map(|x| x + middle + slant * height);
            (x[1].min(opening.x[1]) - x[0].max(opening.x[0])).max(0.0)
        };
        let share = heights.iter().map(at).sum::<f32>() / (heights.len() as f32 * width);
        if share > 0.0 {
            match &mut seen {
                // Both ends of an opening that leaves the period at one side belong to one step.
                Some((step, known)) if *step == opening.step => *known += share,
                _ => {
                    if let Some((step, share)) = seen.replace((opening.step, share)) {
                        push(out, begin, step, share);
                    }
                }
            }
        }
    }
    if let Some((step, share)) = seen {
        push(out, begin, step, share);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_the_steps_one_by_one() {
        let patch = Patch::sheared(0, 0, 50e-6, 1e-6, [400, 1]);
        // 300 steps of an opening that leaves the period at one side and comes in at the other.
        let mut openings = Vec::new();
        for step in 0..300_u32 {
            let low = -60e-6 + 0.4e-6 * step as f32;
            for shift in [0.0, -100e-6] {
                let x = [(low + shift).max(-50e-6), (low + shift + 20e-6).min(50e-6)];
                if x[1] > x[0] {
                    openings.push(Opening { step, x });
                }
            }
        }
        let mut runs = Vec::new();
        let (mut all, mut steps) = (0, 0);
        for leaf in patch.leaves() {
            let begin = runs.len();
            step_runs(&patch, leaf, &openings, &mut runs);
            let found: Vec<(u32, f32)> = runs[begin..].iter().flat_map(StepRun::steps).collect();
            let mut one_by_one: Vec<(u32, f32)> = Vec::new();
            for step in 0..300 {
                let own: Vec<Opening> =
                    openings.iter().filter(|it| it.step == step).copied().collect();
                let mut one = Vec::new();
                step_runs(&patch, leaf, &own, &mut one);
                one_by_one.extend(one.iter().flat_map(StepRun::steps));
            }
            assert_eq!(found, one_by_one);
            (all, steps) = (all + runs.len() - begin, steps + found.len());
        }
        assert!(steps > 3000 && all * 3 < steps, "{all} runs of {steps} steps");
    }
}
