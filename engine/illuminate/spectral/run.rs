//! Neighbouring cells that are as good as one: rims of facets are cut into hundreds.

use super::NodeLaw;

/// How far cells are made one.
#[derive(Debug)]
pub(super) struct Limits {
    /// m.
    pub(super) width: f64,
    /// Change of the optical depth.
    pub(super) depth: f64,
    /// Deviation of the displacement from a straight line, standard deviation, m.
    pub(super) residual: f64,
}

/// Laws of a run at a node: straight lines, and the variance that they leave of the displacement.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fitted {
    pub(super) ends: [NodeLaw; 2],
    pub(super) residual: f64,
}

/// Integrals of a piecewise linear function over a run, x from its low end.
#[derive(Debug, Clone, Copy, Default)]
struct Integrals {
    value: f64,
    times_x: f64,
    square: f64,
}

impl Integrals {
    fn add(&mut self, [a, b]: [f64; 2], [at_a, at_b]: [f64; 2]) {
        let width = b - a;
        self.value += width * 0.5 * (at_a + at_b);
        self.times_x += width / 6.0 * (2.0 * a * at_a + a * at_b + b * at_a + 2.0 * b * at_b);
        self.square += width / 3.0 * (at_a * at_a + at_a * at_b + at_b * at_b);
    }

    /// Ends of the straight line closest over [0, width], and the mean square that it leaves.
    fn line(&self, width: f64) -> ([f64; 2], f64) {
        let mean = self.value / width;
        let rise = 12.0 * (self.times_x - 0.5 * width * self.value) / (width * width);
        let left = self.square / width - mean * mean - rise * rise / 12.0;
        ([mean - 0.5 * rise, mean + 0.5 * rise], left.max(0.0))
    }
}

/// Cells that follow one another.
#[derive(Debug, Default)]
pub(super) struct Run {
    /// Ends of the cells, m from the beamlet's centre.
    x: Vec<[f64; 2]>,
    /// `[cell][node]`.
    laws: Vec<[NodeLaw; 2]>,
    /// Displacement averaged over the energies, and the depth where the run begins.
    mean: Integrals,
    depth: f64,
}

impl Run {
    pub(super) fn clear(&mut self) {
        self.x.clear();
        self.laws.clear();
        self.mean = Integrals::default();
    }

    /// Begins with a cell, which is then pushed.
    pub(super) fn begin(&mut self, x: [f64; 2], mean: [NodeLaw; 2]) {
        self.depth = mean[0].depth;
        self.mean.add([0.0, x[1] - x[0]], mean.map(|law| law.x));
    }

    /// Whether a cell belongs to the run; if so, its mean laws are counted in.
    pub(super) fn takes(&mut self, x: [f64; 2], mean: [NodeLaw; 2], limits: &Limits) -> bool {
        let (Some([low, _]), Some([_, high])) = (self.x.first(), self.x.last()) else {
            return false;
        };
        let width = x[1] - low;
        if width > limits.width
            || high.to_bits() != x[0].to_bits()
            || mean.iter().any(|law| (law.depth - self.depth).abs() > limits.depth)
        {
            return false;
        }
        let mut with = self.mean;
        with.add(x.map(|x| x - low), mean.map(|law| law.x));
        let (_, left) = with.line(width);
        let fits = left <= limits.residual * limits.residual;
        if fits {
            self.mean = with;
        }
        fits
    }

    pub(super) fn push(&mut self, x: [f64; 2], laws: &[[NodeLaw; 2]]) {
        self.x.push(x);
        self.laws.extend_from_slice(laws);
    }

    /// Laws of the run at every node, and where it is; a single cell stays as it is.
    #[allow(clippy::cast_possible_truncation, reason = "ends of cells are f32")]
    pub(super) fn fit(&self, nodes: usize, fitted: &mut Vec<Fitted>) -> Option<[f32; 2]> {
        let (low, high) = (self.x.first()?[0], self.x.last()?[1]);
        fitted.clear();
        if self.x.len() == 1 {
            fitted.extend(self.laws.iter().map(|&ends| Fitted { ends, residual: 0.0 }));
        } else {
            fitted.extend((0..nodes).map(|node| self.fit_node(node, nodes, high - low)));
        }
        Some([low as f32, high as f32])
    }

    fn fit_node(&self, node: usize, nodes: usize, width: f64) -> Fitted {
        let low = self.x[0][0];
        let mut sums = [Integrals::default(); 4];
        for (x, laws) in self.x.iter().zip(self.laws[node..].iter().step_by(nodes)) {
            let x = x.map(|x| x - low);
            let of = |f: fn(&NodeLaw) -> f64| [f(&laws[0]), f(&laws[1])];
            let values = [of(|l| l.depth), of(|l| l.x), of(|l| l.z), of(|l| l.slope_x)];
            sums.iter_mut().zip(values).for_each(|(sum, ends)| sum.add(x, ends));
        }
        let [depth, x, z, slope_x] = sums.map(|sum| sum.line(width));
        let end =
            |i: usize| NodeLaw { depth: depth.0[i], x: x.0[i], z: z.0[i], slope_x: slope_x.0[i] };
        Fitted { ends: [end(0), end(1)], residual: x.1 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_of_one_line_is_that_line_and_steps_leave_their_variance() {
        let law = |x: f64| NodeLaw { x, ..NodeLaw::default() };
        let mut run = Run::default();
        for (a, b) in [(1.0, 1.5), (1.5, 1.6), (1.6, 3.0)] {
            run.push([a, b], &[[law(2.0 * a), law(2.0 * b)]]);
        }
        let mut fitted = Vec::new();
        assert_eq!(run.fit(1, &mut fitted), Some([1.0, 3.0]));
        let Fitted { ends: [low, high], residual } = fitted[0];
        assert!((low.x - 2.0).abs() < 1e-12 && (high.x - 6.0).abs() < 1e-12, "{low:?} {high:?}");
        assert!(residual < 1e-12, "{residual}");

        // A step of height 1 in the middle: the closest line rises by 1.5 and leaves 1/16.
        let mut run = Run::default();
        run.push([0.0, 1.0], &[[law(0.0), law(0.0)]]);
        run.push([1.0, 2.0], &[[law(1.0), law(1.0)]]);
        run.fit(1, &mut fitted);
        let Fitted { ends: [low, high], residual } = fitted[0];
        assert!((high.x - low.x - 1.5).abs() < 1e-12, "{low:?} {high:?}");
        assert!((residual - 1.0 / 16.0).abs() < 1e-12, "{residual}");
    }
}
