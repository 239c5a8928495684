//! Where surfaces are not upright. An upright wall bends light along x alone: none of it lands in
//! another row of pixels.

use glam::DVec3;

use super::{Component, Sample};

/// Sine of the slope below which a facet is upright.
const UPRIGHT: f64 = 1e-6;

/// Ranges of z that hold the facets of a component that are not upright, the lower and the upper, m.
pub type Lids = [[f64; 2]; 2];

/// No facet yet.
const NONE: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];

/// Gathers the lids of a component whose middle is at `middle`, z in m.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gathered {
    middle: f64,
    /// `None` once a facet reaches over the middle.
    lids: Option<Lids>,
}

impl Gathered {
    pub(super) fn new(component: &Component) -> Self {
        let [low, high] = component.bounds.map(|corner| corner[2]);
        Self { middle: low.midpoint(high), lids: Some([NONE; 2]) }
    }

    pub(super) fn add(&mut self, [a, b, c]: [DVec3; 3]) {
        let Some(lids) = &mut self.lids else { return };
        let normal = (b - a).cross(c - a);
        if normal.z.abs() <= UPRIGHT * normal.length() {
            return;
        }
        let [low, high] = [a.z.min(b.z).min(c.z), a.z.max(b.z).max(c.z)];
        if low < self.middle && high > self.middle {
            self.lids = None;
            return;
        }
        let lid = &mut lids[usize::from(low >= self.middle)];
        *lid = [lid[0].min(low), lid[1].max(high)];
    }

    pub(super) const fn lids(&self) -> Option<Lids> {
        self.lids
    }
}

impl Sample {
    /// Finds the lids of all components of its own triangles.
    pub(super) fn find_lids(&mut self) {
        let mut all: Vec<Gathered> = self.components.iter().map(Gathered::new).collect();
        for (triangle, component) in self.triangles.iter().zip(&self.triangle_component) {
            let corners = triangle.map(|v| DVec3::from_array(self.vertices[v as usize]));
            all[*component as usize].add(corners);
        }
        for (component, gathered) in self.components.iter_mut().zip(all) {
            component.lids = gathered.lids();
        }
    }
}
