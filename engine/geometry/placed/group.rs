//! All places of one object.

use glam::DVec3;

use super::solid::Solid;
use super::{Place, Prototype};
use crate::surface::bounds_of;

/// All places of one object.
#[derive(Debug)]
pub(crate) struct Group {
    pub(crate) object: u32,
    pub(crate) prototype: Prototype,
    pub(crate) places: Vec<Place>,
    /// They are known to be disjoint.
    pub(crate) apart: bool,
}

impl Group {
    /// Box around all places in the world.
    pub(crate) fn bounds(&self) -> [DVec3; 2] {
        let own = self.prototype.bounds();
        let corners = self.places.iter().flat_map(|place| place.bounds(own));
        bounds_of(corners)
    }

    /// Its surface in a place.
    pub(super) const fn solid<'a>(&'a self, place: &'a Place) -> Solid<'a> {
        Solid { object: self.object, prototype: &self.prototype, place }
    }
}
