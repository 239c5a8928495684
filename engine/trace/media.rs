//! Materials of a scene by index, medium 0 being the surroundings, with their constants.

use crate::Result;
use crate::material::{self, Constants};
use crate::scene::Scene;

/// Materials by index; index 0 is the surroundings.
#[derive(Debug, Clone)]
pub struct Media {
    /// Names.
    pub names: Vec<String>,
    /// Constants at the scene's energy, by material.
    pub constants: Vec<Constants>,
    /// Material of each object.
    pub of_object: Vec<u32>,
}

impl Media {
    /// Collects the materials of a scene.
    ///
    /// # Errors
    /// As [`material::constants`].
    pub fn of(scene: &Scene) -> Result<Self> {
        let mut media = Self {
            names: vec![scene.surroundings.clone()],
            constants: vec![material::constants_for(
                scene,
                &scene.surroundings,
                "surroundings.material",
            )?],
            of_object: Vec::with_capacity(scene.objects.len()),
        };
        for (number, object) in scene.objects.iter().enumerate() {
            let index = match media.names.iter().position(|n| *n == object.material) {
                Some(index) => index,
                None => {
                    let key = format!("object[{number}].material");
                    media.constants.push(material::constants_for(scene, &object.material, &key)?);
                    media.names.push(object.material.clone());
                    media.names.len() - 1
                }
            };
            media.of_object.push(u32::try_from(index).unwrap_or(u32::MAX));
        }
        Ok(media)
    }

    /// Material inside and outside of a surface, by its objects.
    #[must_use]
    pub fn sides(&self, object: u32, outside: Option<u32>) -> [u32; 2] {
        [self.of_object[object as usize], outside.map_or(0, |o| self.of_object[o as usize])]
    }
}
