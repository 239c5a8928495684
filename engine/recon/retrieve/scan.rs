//! Places of values, and the values of a curve that are fitted.

use super::background_term::BackgroundTerm;
use super::flags;
use super::value_noise::ValueNoise;

/// Places of values: pairs of indices into distinct x and z.
#[derive(Debug, Clone, Default)]
pub(super) struct Points {
    /// Distinct places along x and z, m.
    pub(super) along: [Vec<f64>; 2],
    /// Indices of each point in them.
    pub(super) at: Vec<[usize; 2]>,
    /// Column of each point in its group; empty where all columns have one curve.
    pub(super) columns: Vec<usize>,
}

impl Points {
    /// Points at these places.
    pub(super) fn of(places: &[[f64; 2]]) -> Self {
        let along = [0, 1].map(|axis| {
            let mut all: Vec<f64> = places.iter().map(|place| place[axis]).collect();
            all.sort_by(f64::total_cmp);
            all.dedup();
            all
        });
        let index = |axis: usize, place: f64| along[axis].partition_point(|other| *other < place);
        let at = places.iter().map(|place| [0, 1].map(|axis| index(axis, place[axis]))).collect();
        Self { along, at, columns: Vec::new() }
    }

    /// The points as values of columns whose curves repeat after `repeats` columns, step after step.
    pub(super) fn of_columns(mut self, repeats: usize) -> Self {
        if repeats > 1 {
            self.columns = (0..self.at.len()).map(|index| index % repeats).collect();
        }
        self
    }

    /// Points at these places along x, of slits.
    pub(super) fn along_x(places: impl Iterator<Item = f64>) -> Self {
        Self::of(&places.map(|x| [x, 0.0]).collect::<Vec<_>>())
    }

    /// Place of a point, m.
    pub(super) fn place(&self, point: usize) -> [f64; 2] {
        [0, 1].map(|axis| self.along[axis][self.at[point][axis]])
    }

    /// Least and greatest place along each axis, m.
    pub(super) fn ends(&self) -> [[f64; 2]; 2] {
        [0, 1].map(|axis| {
            let all = &self.along[axis];
            all.first().zip(all.last()).map_or([0.0; 2], |(low, high)| [*low, *high])
        })
    }

    /// Half the distance of the outermost places along each axis, m.
    pub(super) fn half(&self) -> [f64; 2] {
        self.ends().map(|[low, high]| (high - low) / 2.0)
    }
}

/// Coordinates of places along an axis, m.
pub(super) fn along(places: &[[f64; 2]], axis: usize) -> Vec<f64> {
    places.iter().map(|place| place[axis]).collect()
}

/// Places and noise that all curves of an image share.
#[derive(Debug, Clone)]
pub(super) struct Scan {
    /// Place of each value, m: a mask offset, or a pixel of a beamlet. Slits have z = 0.
    pub(super) places: Vec<[f64; 2]>,
    pub(super) points: Points,
    /// Weight of each value in an integral over the scan.
    pub(super) shares: Vec<f64>,
    /// Noise of the values.
    pub(super) noise: ValueNoise,
    /// Background of the curves.
    pub(super) background: BackgroundTerm,
}

/// Values of a curve that count.
#[derive(Debug, Clone)]
pub(super) struct Values {
    pub(super) points: Points,
    pub(super) values: Vec<f64>,
    /// Weight of each value in an integral over the scan.
    pub(super) shares: Vec<f64>,
    pub(super) flags: u32,
    /// Least and greatest value.
    pub(super) range: [f64; 2],
}

impl Scan {
    /// A scan of places that have the same weight.
    pub(super) fn new(
        places: Vec<[f64; 2]>,
        noise: ValueNoise,
        background: BackgroundTerm,
    ) -> Self {
        let shares = vec![1.0; places.len()];
        Self { points: Points::of(&places), places, shares, noise, background }
    }

    /// A scan of slits over offsets along x, each with its weight in an integral.
    pub(super) fn along_x(
        offsets: &[f64],
        shares: Vec<f64>,
        noise: ValueNoise,
        background: BackgroundTerm,
    ) -> Self {
        let places = offsets.iter().map(|x| [*x, 0.0]).collect();
        Self { shares, ..Self::new(places, noise, background) }
    }

    /// The scan of columns whose curves repeat after `repeats` columns, step after step.
    pub(super) fn of_columns(mut self, repeats: usize) -> Self {
        self.points = self.points.of_columns(repeats);
        self
    }

    /// Sorts out values; flags say why there is no answer. `needed`: fewest values.
    pub(super) fn values(&self, curve: impl Iterator<Item = f32>, needed: usize) -> Values {
        let (mut values, mut kept) = (Vec::with_capacity(self.places.len()), Vec::new());
        let curve = curve.take(self.places.len());
        let (flags, range) = self.noise.sort_out(curve, needed, |index, value| {
            values.push(value);
            kept.push(index);
        });
        if kept.len() == self.places.len() {
            let (points, shares) = (self.points.clone(), self.shares.clone());
            return Values { points, values, shares, flags, range };
        }
        let places: Vec<[f64; 2]> = kept.iter().map(|index| self.places[*index]).collect();
        let shares = kept.iter().map(|index| self.shares[*index]).collect();
        let columns = kept.iter().filter_map(|index| self.points.columns.get(*index).copied());
        let points = Points { columns: columns.collect(), ..Points::of(&places) };
        Values { points, values, shares, flags, range }
    }

    /// The flag of a centre outside of the scan; 0 within.
    pub(super) fn outside(&self, centre: [f64; 2]) -> u32 {
        let beyond = |([low, high], at): ([f64; 2], f64)| at < low || at > high;
        let is_outside = self.points.ends().into_iter().zip(centre).any(beyond);
        if is_outside { flags::OUTSIDE } else { 0 }
    }

    /// Half the distance of the outermost places along x, m.
    pub(super) fn half(&self) -> f64 {
        self.points.half()[0]
    }
}

impl Values {
    /// Place along x, value and weight of each point.
    pub(super) fn along_x(&self) -> impl Iterator<Item = [f64; 3]> {
        let x = self.points.at.iter().map(|[x, _]| self.points.along[0][*x]);
        x.zip(&self.values).zip(&self.shares).map(|((x, value), share)| [x, *value, *share])
    }

    /// Integral above `floor`, its centroid, and its second moments xx, zz and xz about it.
    pub(super) fn moments(&self, floor: f64) -> [f64; 6] {
        let sum = |of: &dyn Fn([f64; 2]) -> f64| -> f64 {
            let terms = self.values.iter().zip(&self.shares).enumerate();
            terms
                .map(|(k, (value, share))| share * (value - floor) * of(self.points.place(k)))
                .sum()
        };
        let light = sum(&|_| 1.0);
        let [x, z] = [0, 1].map(|axis| sum(&|place| place[axis]) / light);
        let second = |of: &dyn Fn(f64, f64) -> f64| sum(&|[px, pz]| of(px - x, pz - z)) / light;
        [light, x, z, second(&|x, _| x * x), second(&|_, z| z * z), second(&|x, z| x * z)]
    }
}
