//! Responses of designs that are lit from the same lines and rays. Lines and rays are judged by the worst of them.

use super::response::{Opening, Response};
use super::windows::Landed;
use std::sync::Arc;

/// Share of an aperture by which the edges of two designs may differ of which one is judged by the other. Lines that
/// resolve the light of one resolve that of the other: light changes by at most this share of itself
/// (`designs_of_one_walk_have_the_light_of_their_own_runs`).
const NEAR: f32 = 1.0 / 6.0;

/// Responses of designs with one lattice, whose masks differ.
#[derive(Debug)]
pub(crate) struct Responses {
    designs: Vec<Arc<Response>>,
    /// Designs by which lines and rays are judged: each design is near to one of these.
    judges: Vec<Arc<Response>>,
    /// Numbers of the judges whose windows no earlier judge has.
    pub(crate) distinct: Vec<usize>,
    /// Place in `distinct` of the windows of each judge.
    windows: Vec<usize>,
    /// Largest share of light through the bars of the sample mask.
    leak: f32,
    /// Largest change of the share of light that passes a window, per displacement, 1/m.
    pub(crate) steepest: f64,
}

/// Openings of a beamlet.
#[derive(Debug, Clone)]
pub(crate) struct ColumnOpenings {
    /// Openings of each judge.
    pub judges: Vec<Vec<Opening>>,
    /// Openings of all designs that no other one contains, in the order of x; their mask steps have no meaning.
    pub widest: Vec<Opening>,
}

impl ColumnOpenings {
    fn new(judges: Vec<Vec<Opening>>, mut all: Vec<Opening>) -> Self {
        all.sort_by(|a, b| a.x[0].total_cmp(&b.x[0]).then(b.x[1].total_cmp(&a.x[1])));
        let mut widest: Vec<Opening> = Vec::new();
        for opening in all {
            if widest.last().is_none_or(|last| opening.x[1] > last.x[1]) {
                widest.push(opening);
            }
        }
        Self { judges, widest }
    }

    /// Openings of the first design, where that is the only one.
    pub(crate) fn first(&self) -> &[Opening] {
        self.judges.first().map_or(&[], Vec::as_slice)
    }
}

impl Responses {
    /// Responses of designs, of which there is at least one.
    pub(crate) fn new(designs: Vec<Arc<Response>>) -> Self {
        let mut order: Vec<&Arc<Response>> = designs.iter().collect();
        order.sort_by(|a, b| a.order(b));
        let mut judges: Vec<Arc<Response>> = Vec::new();
        for design in order {
            if !judges.iter().any(|judge| design.is_near(judge, NEAR)) {
                judges.push(Arc::clone(design));
            }
        }
        let (mut distinct, mut windows) = (Vec::<usize>::new(), Vec::new());
        for (number, response) in judges.iter().enumerate() {
            let same = distinct.iter().position(|at| judges[*at].has_windows_of(response));
            windows.push(same.unwrap_or(distinct.len()));
            if same.is_none() {
                distinct.push(number);
            }
        }
        let leak = designs.iter().map(|design| design.leak).fold(0.0, f32::max);
        let steepest = designs.iter().map(|design| design.steepest()).fold(0.0, f64::max);
        Self { designs, judges, distinct, windows, leak, steepest }
    }

    /// Response of the first design: places in the cell plane and on the analyser, and light that passes an optical
    /// depth, are those of all.
    pub(crate) fn first(&self) -> &Response {
        &self.designs[0]
    }

    /// Responses by which lines and rays are judged.
    pub(crate) fn judges(&self) -> impl Iterator<Item = &Response> {
        self.judges.iter().map(|response| &**response)
    }

    /// Place in `distinct` of the windows of a judge.
    pub(crate) fn windows_of(&self, judge: usize) -> usize {
        self.windows[judge]
    }

    /// Openings of the beamlet at `column` of the lattice.
    pub(crate) fn openings(&self, column: usize) -> ColumnOpenings {
        let judges = self.judges().map(|response| response.openings(column)).collect();
        let all = self.designs.iter().flat_map(|response| response.openings(column)).collect();
        ColumnOpenings::new(judges, all)
    }

    /// Mask steps that differ enough to count, of the design with the fewest.
    pub(crate) fn fewest_steps(&self) -> usize {
        self.designs.iter().map(|response| response.steps()).min().unwrap_or(1)
    }

    /// Share of the light behind a sample mask of a rectangle that a step opens to a share.
    pub(crate) fn lit(&self, open: f32) -> f32 {
        self.leak + (1.0 - self.leak) * open
    }

    /// [`Response::change`] of each of the distinct windows.
    pub(crate) fn changes(
        &self,
        column: usize,
        results: [Landed; 2],
        half: f32,
    ) -> impl Iterator<Item = f32> {
        let apart = self.distinct.iter().map(|judge| &self.judges[*judge]);
        apart.map(move |response| response.change(column, results, half))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_widest_openings_contain_all_others() {
        let opening = |low: f32, high: f32| Opening { step: 0, x: [low, high] };
        let designs = vec![
            vec![opening(-5.0, 1.0), opening(2.0, 4.0), opening(6.0, 9.0)],
            vec![opening(-4.0, 1.0), opening(0.0, 4.0), opening(6.0, 9.0)],
        ];
        let all = designs.concat();
        let openings = ColumnOpenings::new(designs, all);
        let widest: Vec<[f32; 2]> = openings.widest.iter().map(|opening| opening.x).collect();
        assert_eq!(widest, [[-5.0, 1.0], [0.0, 4.0], [6.0, 9.0]]);
        assert_eq!(openings.first().len(), 3);
    }
}
