//! Which mask steps see a rectangle, and how much of it.

use super::patch::Patch;
use super::response::Opening;
use beamlet_core::numbers::single;
use std::ops::Range;

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

/// True if some step opens a part of the rectangle whose runs these are.
pub(super) fn is_open(runs: &[StepRun]) -> bool {
    runs.iter().any(|run| run.share > 0.0)
}

/// Appends steps of the same share, to the last run from `begin` on where they continue that.
fn push(out: &mut Vec<StepRun>, begin: usize, steps: Range<u32>, share: f32) {
    let count = steps.end - steps.start;
    match out[begin..].last_mut() {
        Some(run)
            if run.first + run.count == steps.start && run.share.to_bits() == share.to_bits() =>
        {
            run.count += count;
        }
        _ => out.push(StepRun { first: steps.start, count, share }),
    }
}

/// Share of a rectangle between these x that lies in an opening. From its upper to its lower end it slants
/// by `slant`, about the middle: a corner alone may be open.
fn open_share(x: [f32; 2], slant: f32, opening: [f32; 2]) -> f32 {
    let half = 0.5 * slant.abs();
    let width = x[1] - x[0];
    if x[1] + half <= opening[0] || x[0] - half >= opening[1] {
        return 0.0;
    }
    if x[0] - half >= opening[0] && x[1] + half <= opening[1] {
        return 1.0;
    }
    if half == 0.0 {
        return (x[1].min(opening[1]) - x[0].max(opening[0])) / width;
    }
    // In f64: differences of squares.
    let [low, high] = opening.map(f64::from);
    let half = f64::from(half);
    // Integral from `low` of x that is moved into the opening, from its lower end.
    let moved =
        |x: f64| 0.5 * (x.clamp(low, high) - low).powi(2) + (high - low) * (x - high).max(0.0);
    let [begin, end] = x.map(|x| {
        let x = f64::from(x);
        (moved(x + half) - moved(x - half)) / (2.0 * half)
    });
    single((end - begin) / f64::from(width))
}

/// Appends the steps that light a rectangle: those whose openings show a part of it, and the others with
/// a share of 0 where bars leak. `openings`: of its beamlet, by step. `leaking`: number of all steps where
/// bars leak.
pub(super) fn step_runs(
    patch: &Patch,
    leaf: u32,
    openings: &[Opening],
    leaking: Option<u32>,
    out: &mut Vec<StepRun>,
) {
    let node = &patch.nodes[leaf as usize];
    let middle = patch.shear * (node.centre()[1] - 0.5);
    let slant = patch.shear * node.height();
    let begin = out.len();
    let mut next = 0;
    let mut append = |step: u32, share: f32| {
        if leaking.is_some() && step > next {
            push(out, begin, next..step, 0.0);
        }
        push(out, begin, step..step + 1, share);
        next = step + 1;
    };
    let mut seen: Option<(u32, f32)> = None;
    for opening in openings {
        let share = open_share(node.x.map(|x| x + middle), slant, opening.x);
        if share > 0.0 {
            match &mut seen {
                // Both ends of an opening that leaves the period at one side belong to one step.
                Some((step, known)) if *step == opening.step => *known += share,
                _ => {
                    if let Some((step, share)) = seen.replace((opening.step, share)) {
                        append(step, share);
                    }
                }
            }
        }
    }
    if let Some((step, share)) = seen {
        append(step, share);
    }
    if let Some(steps) = leaking.filter(|steps| *steps > next) {
        push(out, begin, next..steps, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_open_share_of_a_slanting_rectangle_is_its_mean_over_heights() {
        let opening = [-20e-6, 30e-6];
        let cases = [
            ([-25e-6, -21e-6], 8e-6),
            ([-60e-6, -40e-6], 45e-6),
            ([-30e-6, 50e-6], -120e-6),
            ([29e-6, 29.01e-6], 3e-6),
            ([-20.01e-6, -19.99e-6], 1e-9),
            ([0.0, 1e-6], 5e-6),
            ([31e-6, 40e-6], -1e-6),
        ];
        for (x, slant) in cases {
            let at = |index: u32| {
                let off = slant * ((f64::from(index) + 0.5) / 1e5 - 0.5);
                let [low, high] = x.map(|x: f64| (x + off).clamp(opening[0], opening[1]));
                (high - low) / (x[1] - x[0])
            };
            let mean = (0..100_000).map(at).sum::<f64>() / 1e5;
            let share = open_share(x.map(single), single(slant), opening.map(single));
            // Ends in f32 are right to 4e-12 m.
            let near = 1e-5 + 1e-11 / (x[1] - x[0]);
            assert!((f64::from(share) - mean).abs() < near, "{x:?} {slant}: {share}, not {mean}");
        }
    }

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
            step_runs(&patch, leaf, &openings, None, &mut runs);
            let found: Vec<(u32, f32)> = runs[begin..].iter().flat_map(StepRun::steps).collect();
            let mut one_by_one: Vec<(u32, f32)> = Vec::new();
            for step in 0..300 {
                let own: Vec<Opening> =
                    openings.iter().filter(|it| it.step == step).copied().collect();
                let mut one = Vec::new();
                step_runs(&patch, leaf, &own, None, &mut one);
                one_by_one.extend(one.iter().flat_map(StepRun::steps));
            }
            assert_eq!(found, one_by_one);
            // Where bars leak the other steps follow with a share of 0.
            let mut leaking = Vec::new();
            step_runs(&patch, leaf, &openings, Some(300), &mut leaking);
            let (open, dark): (Vec<_>, Vec<_>) =
                leaking.iter().flat_map(StepRun::steps).partition(|(_, share)| *share > 0.0);
            assert_eq!((&open, open.len() + dark.len()), (&found, 300));
            assert!(leaking.iter().flat_map(StepRun::steps).map(|it| it.0).eq(0..300));
            (all, steps) = (all + runs.len() - begin, steps + found.len());
        }
        assert!(steps > 3000 && all * 3 < steps, "{all} runs of {steps} steps");
    }
}
