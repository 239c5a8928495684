//! Integrals of the first order over a rectangle, by sheet of surface: one side of one component.

use super::polygon::{Area, Corner};
use super::sample_facets::SurfaceStep;
use arrayvec::ArrayVec;
use beamlet_core::numbers;
use beamlet_interface::FLAG_SHARE_SHIFT;

/// Most sheets of surface (component and side) in a rectangle.
const MOST_SHEETS: usize = 8;
/// Sheets cover a rectangle a whole number of times to this.
pub(super) const WHOLE: f64 = 1e-4;
/// Standard deviation of a parabola of curvature 1 about its chord, over a width of 1.
const BOW: f64 = 0.037;
/// Standard deviation of a line with random kinks, per standard deviation of its slope.
const KINKS: f64 = 0.2;

/// Effect of one side of one component over a rectangle: integrals over its area.
#[derive(Clone, Copy, Default)]
pub(super) struct Sheet {
    component: u32,
    front: bool,
    /// Integral of 1.
    area: f64,
    /// Integrals of the displacement along x per step of delta: itself, times x and z from the centre,
    /// squared.
    moved: f64,
    by_x: f64,
    by_z: f64,
    square: f64,
    /// Integrals of the displacement along z per step of delta: itself, times x and z, squared.
    moved_z: f64,
    z_by_x: f64,
    z_by_z: f64,
    square_z: f64,
    /// Integrals by axis: of the variance of a facet's places about its centroid, m2 and rows2; times the
    /// displacement along x; times its square.
    spread: [[f64; 3]; 2],
    /// Least and largest of both displacements, per facet.
    range: [f64; 2],
    range_z: [f64; 2],
}

impl Sheet {
    fn new(component: u32, front: bool) -> Self {
        let none = [f64::INFINITY, f64::NEG_INFINITY];
        Self { component, front, range: none, range_z: none, ..Self::default() }
    }

    /// Adds a facet's part of a rectangle with this centre, and its displacements per step of delta.
    pub(super) fn add(&mut self, part: &Area, centre: Corner, [moved, moved_z]: [f64; 2]) {
        let Area { area, centroid, moments } = *part;
        let [x, z] = [centroid[0] - centre[0], centroid[1] - centre[1]];
        self.area += area;
        self.moved += area * moved;
        self.by_x += area * moved * x;
        self.by_z += area * moved * z;
        self.square += area * moved * moved;
        for (spread, own) in self.spread.iter_mut().zip([moments[0], moments[2]]) {
            *spread = [spread[0] + own, spread[1] + own * moved, spread[2] + own * moved * moved];
        }
        self.moved_z += area * moved_z;
        self.z_by_x += area * moved_z * x;
        self.z_by_z += area * moved_z * z;
        self.square_z += area * moved_z * moved_z;
        widen(&mut self.range, moved);
        widen(&mut self.range_z, moved_z);
    }
}

/// Widens a range to hold a value.
fn widen(range: &mut [f64; 2], value: f64) {
    *range = [range[0].min(value), range[1].max(value)];
}

/// Squared deviations from a mean, from integrals of 1, of the values and of their squares.
fn about([ones, values, squares]: [f64; 3], mean: f64) -> f64 {
    squares - 2.0 * mean * values + mean * mean * ones
}

/// How far the sum of `layers` values in a range may be from its mean.
fn farthest([low, high]: [f64; 2], mean: f64, layers: f64) -> f64 {
    (layers * high - mean).max(mean - layers * low)
}

/// Surfaces that all rays of a rectangle cross.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Met {
    pub(super) crossings: u32,
    /// Sum of the hashes of their objects,
    pub(super) signature: u32,
    /// and those entered less those left: not zero where a mesh is open.
    pub(super) balance: u32,
}

impl Met {
    /// Adds a surface of the object with this hash that is crossed `times` times.
    pub(super) fn add(&mut self, hash: u32, front: bool, times: u32) {
        let all = hash.wrapping_mul(times);
        self.crossings += times;
        self.signature = self.signature.wrapping_add(all);
        self.balance =
            if front { self.balance.wrapping_add(all) } else { self.balance.wrapping_sub(all) };
    }
}

/// Planes fitted to the displacements of all sheets of a rectangle.
#[derive(Default)]
pub(super) struct SheetFits {
    /// Surfaces that its rays cross.
    pub(super) met: Met,
    /// Slope over x of the displacement along x, over z of the same, over z of that along z.
    pub(super) slope: f64,
    pub(super) across: f64,
    pub(super) slope_z: f64,
    /// Variances about the fits: of the optical depth along x and z, of the displacements along x and z, m2.
    pub(super) depth: f64,
    pub(super) depth_z: f64,
    pub(super) variance: f64,
    pub(super) variance_z: f64,
    /// Width and height of facets whose displacement along x is outstanding, relative to the rectangle:
    /// m2.
    pub(crate) spread: [f64; 2],
    /// Farthest that the displacements along x and z are off their means, m.
    pub(super) farthest: [f64; 2],
}

impl SheetFits {
    /// Fits the displacements of each sheet by a plane over a rectangle of this width and height, m, whose
    /// variances of x and z are `squares`; nothing where a sheet does not cover all of it.
    pub(super) fn of(
        sums: &RectangleSums,
        surfaces: &[SurfaceStep],
        analyser: f64,
        [width, height]: [f64; 2],
        squares: [f64; 2],
    ) -> Option<Self> {
        let area = sums.area;
        let [x2, z2] = squares;
        let mut fits = Self { met: sums.whole, ..Self::default() };
        for sheet in &sums.sheets {
            let layers = (sheet.area / area).round();
            if (sheet.area / area - layers).abs() > WHOLE || layers > f64::from(u16::MAX) {
                return None;
            }
            if layers == 0.0 {
                continue;
            }
            let count = numbers::whole::<u32>(layers);
            let step = &surfaces[sheet.component as usize];
            fits.met.add(step.hash, sheet.front, count);
            // Least squares over the rectangle.
            let [by_x, by_z] = [sheet.by_x / area / x2, sheet.by_z / area / z2];
            let mean = sheet.moved / area;
            let all = sheet.square / area - mean * mean / layers;
            let own = (all - by_x * by_x * x2 - by_z * by_z * z2).max(0.0);
            let mean_z = sheet.moved_z / area;
            let [z_by_x, z_by_z] = [sheet.z_by_x / area / x2, sheet.z_by_z / area / z2];
            let all_z = sheet.square_z / area - mean_z * mean_z / layers;
            let own_z = (all_z - z_by_x * z_by_x * x2 - z_by_z * z_by_z * z2).max(0.0);
            fits.slope += step.delta * by_x;
            fits.across += step.delta * by_z;
            fits.slope_z += step.delta * z_by_z;
            fits.farthest[0] += step.delta.abs() * farthest(sheet.range, mean, layers);
            fits.farthest[1] += step.delta.abs() * farthest(sheet.range_z, mean_z, layers);
            fits.variance += step.delta * step.delta * own;
            fits.variance_z += step.delta * step.delta * own_z;
            for (fit, (own, square)) in fits.spread.iter_mut().zip(sheet.spread.iter().zip(squares))
            {
                *fit += step.delta * step.delta * about(*own, mean / layers) / area / square;
            }
            // Depth is the integral of what moves light: a bow where that rises, kinks where it
            // jumps.
            let bow = |change: f64, own: f64, [size, metres]: [f64; 2]| {
                let bow = BOW * change.abs() * size * metres + KINKS * own.sqrt() * metres;
                (step.mu * bow / analyser).powi(2)
            };
            fits.depth += bow(by_x, own, [width, width]);
            // Of z in rows.
            fits.depth_z += bow(z_by_z, own_z, [(12.0 * z2).sqrt(), height]);
        }
        Some(fits)
    }
}

/// Integrals over a rectangle.
pub(super) struct RectangleSums {
    pub(super) centre: Corner,
    pub(crate) area: f64,
    /// Integrals of the optical depth times x and z from the centre.
    pub(super) depth_by_x: f64,
    pub(super) depth_by_z: f64,
    /// The first order is enough, and sheets are few.
    pub(crate) sound: bool,
    /// Facets that fill it.
    pub(crate) whole: Met,
    /// Integrals of the numbers of the result.
    pub(crate) result: [f64; 5],
    pub(crate) sheets: ArrayVec<Sheet, MOST_SHEETS>,
    /// First-order remainder of the displacement.
    pub(crate) first_order: f64,
    /// Least cosine of incidence, over that which the first order needs.
    pub(crate) share: f64,
}

/// Flags of a result whose least cosine of incidence is this share of that which the first order
/// needs.
pub(super) fn flags(share: f64) -> u32 {
    let share = numbers::whole::<u32>(255.0 * share.min(1.0));
    share << FLAG_SHARE_SHIFT
}

impl RectangleSums {
    pub(super) fn new(centre: Corner, area: f64) -> Self {
        Self {
            centre,
            area,
            depth_by_x: 0.0,
            depth_by_z: 0.0,
            sound: true,
            whole: Met::default(),
            result: [0.0; 5],
            sheets: ArrayVec::new(),
            first_order: 0.0,
            share: f64::INFINITY,
        }
    }

    /// The sheet of a component and side; nothing where there are too many.
    pub(super) fn sheet(&mut self, component: u32, front: bool) -> Option<&mut Sheet> {
        let same = |sheet: &Sheet| sheet.component == component && sheet.front == front;
        let place = self.sheets.iter().position(same);
        if place.is_none() {
            self.sheets.try_push(Sheet::new(component, front)).ok()?;
        }
        match place {
            Some(place) => self.sheets.get_mut(place),
            None => self.sheets.last_mut(),
        }
    }
}
