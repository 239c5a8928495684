//! All places of one object.

use glam::DVec3;

use super::{Place, Prototype};
use crate::Component;
use crate::surface::{bounds_of, corners_of};

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

    /// True if a point of the world lies in the body of a place.
    pub(super) fn contains(&self, place: &Place, point: DVec3) -> bool {
        self.prototype.contains(place.own_from_world(point))
    }

    /// A box that lies in the box around any solid that contains a place: around the place itself for a shape,
    /// and around some points of it for a mesh. Boxes of turned boxes are larger, and may reach out of the solid.
    pub(super) fn core(&self, place: &Place) -> [DVec3; 2] {
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        match self.prototype.shape {
            Some(shape) => {
                let linear = place.linear();
                let farthest = |along: DVec3| shape.support(linear.transpose() * along);
                let points = axes.into_iter().flat_map(|axis| [farthest(axis), farthest(-axis)]);
                bounds_of(points.map(|point| place.world_from_own(point)))
            }
            None => {
                let vertices = self.prototype.extremes().iter();
                bounds_of(vertices.map(|vertex| place.world_from_own(*vertex)))
            }
        }
    }

    /// A point of the surface of a place.
    pub(super) fn point(&self, place: &Place) -> DVec3 {
        place.world_from_own(self.prototype.corners(0)[0])
    }

    /// The components of a place.
    pub(crate) fn components(
        &self,
        place: &Place,
        outside: Option<u32>,
    ) -> impl Iterator<Item = Component> {
        let areas = self.prototype.areas(place);
        self.prototype.components.iter().zip(areas).map(move |(own, area)| Component {
            object: self.object,
            outside,
            volume: own.volume * place.volume(),
            area,
            bounds: place.bounds(corners_of(own)).map(Into::into),
            lids: own.lids.and_then(|lids| place.lids(lids)),
            ..Component::default()
        })
    }
}
