//! Integrals of the first order over a rectangle, by sheet of surface: one side of one component.

use super::polygon::Corner;
use crate::interface::FLAG_SHARE_SHIFT;
use crate::numbers;
use arrayvec::ArrayVec;

/// Most sheets of surface (component and side) in a rectangle.
const MOST_SHEETS: usize = 8;

/// What one side of one component does over a rectangle: integrals over its area.
#[derive(Clone, Copy, Default)]
pub(super) struct Sheet {
    pub(super) component: u32,
    pub(super) front: bool,
    /// Of 1.
    pub(super) area: f64,
    /// Of the displacement along x per step of delta: itself, times x and z from the centre,
    /// squared.
    pub(super) moved: f64,
    pub(super) by_x: f64,
    pub(super) by_z: f64,
    pub(super) square: f64,
    /// Of that along z: itself, times x and z, squared.
    pub(super) moved_z: f64,
    pub(super) z_by_x: f64,
    pub(super) z_by_z: f64,
    pub(super) square_z: f64,
    /// By axis: of the variance of a facet's places about its centroid, m2 and rows2; times the
    /// displacement along x; times its square.
    pub(super) spread: [[f64; 3]; 2],
    /// Least and largest of both displacements, per facet.
    pub(super) range: [f64; 2],
    pub(super) range_z: [f64; 2],
}

impl Sheet {
    fn new(component: u32, front: bool) -> Self {
        let none = [f64::INFINITY, f64::NEG_INFINITY];
        Self { component, front, range: none, range_z: none, ..Self::default() }
    }
}

/// Widens a range to hold a value.
pub(super) fn widen(range: &mut [f64; 2], value: f64) {
    *range = [range[0].min(value), range[1].max(value)];
}

/// Squared deviations from a mean, from integrals of 1, of the values and of their squares.
pub(super) fn about([ones, values, squares]: [f64; 3], mean: f64) -> f64 {
    squares - 2.0 * mean * values + mean * mean * ones
}

/// How far the sum of `layers` values in a range may be from its mean.
pub(super) fn farthest([low, high]: [f64; 2], mean: f64, layers: f64) -> f64 {
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
    /// What its rays cross.
    pub(super) met: Met,
    /// Slope over x of the displacement along x, over z of the same, over z of that along z.
    pub(super) slope: f64,
    pub(super) across: f64,
    pub(super) slope_z: f64,
    /// Variances about the fits: of the optical depth, of the displacements along x and z, m2.
    pub(super) depth: f64,
    pub(super) variance: f64,
    pub(super) variance_z: f64,
    /// How wide and high facets are whose displacement along x stands out, beside the rectangle: m2.
    pub(super) spread: [f64; 2],
    /// Farthest that the displacements along x and z are off their means, m.
    pub(super) farthest: [f64; 2],
}

/// Integrals over a rectangle.
pub(super) struct RectangleSums {
    pub(super) centre: Corner,
    pub(super) area: f64,
    /// Of the optical depth times x and z from the centre.
    pub(super) depth_by_x: f64,
    pub(super) depth_by_z: f64,
    /// The first order is enough, and sheets are few.
    pub(super) sound: bool,
    /// Facets that fill it.
    pub(super) whole: Met,
    /// Of the numbers of the result.
    pub(super) result: [f64; 5],
    pub(super) sheets: ArrayVec<Sheet, MOST_SHEETS>,
    /// Of what the first order leaves in the displacement.
    pub(super) first_order: f64,
    /// Least cosine of incidence, over that which the first order needs.
    pub(super) share: f64,
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
