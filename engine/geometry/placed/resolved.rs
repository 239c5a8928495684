//! Exact shapes that cross, as facets without what others cover of them: for mesh files and drawings.

use std::collections::BTreeMap;

use super::{Placed, Prototype, union};
use crate::Sample;
use crate::body::Body;
use crate::nesting::nest;
use crate::surface::{Surface, corners_of, near};
use beamlet_core::error::Result;
use beamlet_core::watch::Task;

impl Sample {
    /// Adds the objects around shapes that cross to the surroundings of their facets: the comparison of
    /// the facets alone does not know them.
    fn surround_resolved(&self, bodies: &mut [Body]) {
        for (at, _) in self.partners.lists() {
            let placed = &self.placed[at as usize];
            let own = &self.components[placed.component as usize];
            let bounds = corners_of(own);
            for component in &mut bodies[own.object as usize].components {
                if near(bounds, corners_of(component), 0.0) {
                    component.outside = component.outside.max(own.outside);
                }
            }
        }
    }

    /// Of each object, the facets of its shapes that cross others, cut by those; `facets`: of a shape in
    /// its own frame.
    ///
    /// # Errors
    /// Facets that cannot be cut; [`beamlet_core::Error::Memory`].
    pub(crate) fn resolved(
        &self,
        facets: impl Fn(&Prototype, &Placed) -> Surface,
    ) -> Result<Vec<Body>> {
        let names: Vec<String> = self.objects.iter().map(|it| it.name.clone()).collect();
        let mut bodies: Vec<Body> = names.iter().map(|_| Body::empty()).collect();
        let object = |at: u32| self.components[self.placed[at as usize].component as usize].object;
        let mut shapes: BTreeMap<u32, Vec<Surface>> = BTreeMap::new();
        let mut overlap = vec![false; names.len()];
        for (at, partners) in self.partners.lists() {
            let placed = &self.placed[at as usize];
            let own = facets(&self.prototypes[placed.prototype as usize], placed);
            let world = own.vertices.iter().map(|it| placed.place.world_from_own(*it)).collect();
            shapes.entry(object(at)).or_default().push(Surface::new(world, own.triangles));
            overlap[object(at) as usize] |= partners.iter().any(|it| object(*it) == object(at));
        }
        for (number, surfaces) in shapes {
            let at = number as usize;
            let body = &mut bodies[at];
            if overlap[at] {
                let whole = union::united(surfaces, true, &names[at], Task::unwatched())?;
                body.replace(&[], std::iter::once((whole, None)), number);
            } else {
                body.replace(&[], surfaces.into_iter().map(|it| (it, None)), number);
            }
        }
        nest(&mut bodies, &names, &vec![None; names.len()], false, Task::unwatched())?;
        self.surround_resolved(&mut bodies);
        Ok(bodies)
    }
}
