//! A mesh file as it was read: triangles, and the names that they go by.

use super::names::Names;
use crate::surface::{Defect, Surface};

/// A mesh file, read.
#[derive(Debug, Default)]
pub(crate) struct MeshFile {
    /// Not yet welded.
    pub(super) surface: Surface,
    pub(super) names: Names,
    /// The length of 1.0 in it, m, if the file states it.
    pub(crate) unit: Option<f64>,
    /// Contents that were left out, in words.
    pub(super) warnings: Vec<String>,
}

impl MeshFile {
    /// One without names.
    pub(super) fn of(surface: Surface) -> Self {
        Self { surface, ..Self::default() }
    }

    /// The triangles of an object, group or material, or all; and warnings about them.
    ///
    /// # Errors
    /// No triangle goes by that name.
    pub(crate) fn into_part(self, group: Option<&str>) -> Result<(Surface, Vec<String>), Defect> {
        match group {
            None => {
                let merged = self.names.merged();
                Ok((self.surface, self.warnings.into_iter().chain(merged).collect()))
            }
            Some(_) => self.part(group),
        }
    }

    /// As [`Self::into_part`], and keeps the file.
    ///
    /// # Errors
    /// As there.
    pub(crate) fn part(&self, group: Option<&str>) -> Result<(Surface, Vec<String>), Defect> {
        let warnings = || self.warnings.iter().cloned();
        let Some(group) = group else {
            return Ok((self.surface.clone(), warnings().chain(self.names.merged()).collect()));
        };
        let is_taken = self.names.taken(group)?;
        let mut part = Surface::default();
        let labels = self.names.of_triangles();
        let mut not_finite = self.surface.not_finite.iter().peekable();
        let mut triangle = 0_usize;
        // Triangles that are not finite were left out of the surface and have a label all the same.
        for (label, number) in labels.iter().zip(1_u32..) {
            if not_finite.next_if_eq(&&number).is_some() {
                if is_taken[*label as usize] {
                    part.not_finite.push(number);
                }
                continue;
            }
            if is_taken[*label as usize] {
                part.push_numbered(self.surface.corners(triangle), number);
            }
            triangle += 1;
        }
        Ok((part, warnings().collect()))
    }
}
