//! Moments of rays: sums over crossings that do not depend on energy, masks or steps.

use beamlet_interface::{
    FLAG_SHARE_SHIFT, MOMENTS_BALANCE, MOMENTS_CROSSINGS, MOMENTS_HEAD, MOMENTS_LEVER,
    MOMENTS_PATH, MOMENTS_PER_MATERIAL, MOMENTS_SLOPE, RayResult,
};

/// Least cosine of incidence of a ray over that below which rays are traced exactly.
pub fn grazing(result: &RayResult) -> f64 {
    f64::from(result.flags >> FLAG_SHARE_SHIFT) / 255.0
}

/// First-order moments of rays, by ray and material. Material 0 is the surroundings.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Moments {
    words: Vec<u32>,
    materials: usize,
    /// Words of a ray.
    stride: usize,
}

/// Moments of one ray in one material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// Path length, m (for the surroundings: minus the length of the empty beam).
    pub path: f32,
    /// Sum of +-slope change per delta times the lever to the analyser, x and z, m.
    pub lever: [f32; 2],
    /// Sum of +-slope change per delta, x and z.
    pub slope: [f32; 2],
}

impl Moments {
    /// Sums as a kernel wrote them: words, materials, and words of each ray beyond its head.
    pub(crate) fn new(words: Vec<u32>, materials: u32, own: usize) -> Self {
        Self { words, materials: materials as usize, stride: MOMENTS_HEAD + own }
    }

    fn ray(&self, ray: usize) -> &[u32] {
        &self.words[ray * self.stride..(ray + 1) * self.stride]
    }

    /// Number of rays.
    #[must_use]
    pub fn len(&self) -> usize {
        self.words.len() / self.stride
    }

    /// True if there are no rays.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.words.is_empty()
    }

    /// Number of materials.
    #[must_use]
    pub const fn materials(&self) -> usize {
        self.materials
    }

    /// Entries less exits, hashed by component: 0 where every one was left as often as entered.
    ///
    /// # Panics
    /// Where there is no such ray.
    #[must_use]
    pub fn balance(&self, ray: usize) -> u32 {
        self.ray(ray)[MOMENTS_BALANCE]
    }

    /// Crossings of a ray.
    ///
    /// # Panics
    /// Where there is no such ray.
    #[must_use]
    pub fn crossings(&self, ray: usize) -> u32 {
        self.ray(ray)[MOMENTS_CROSSINGS]
    }

    /// Moments of a ray in a material.
    ///
    /// # Panics
    /// Where there is no such ray or material.
    #[must_use]
    pub fn of(&self, ray: usize, material: usize) -> Moment {
        assert!(material < self.materials, "material {material} of {}", self.materials);
        let at = MOMENTS_HEAD + material * MOMENTS_PER_MATERIAL;
        let m: &[f32] = bytemuck::cast_slice(&self.ray(ray)[at..at + MOMENTS_PER_MATERIAL]);
        let pair = |at: usize| [m[at], m[at + 1]];
        Moment { path: m[MOMENTS_PATH], lever: pair(MOMENTS_LEVER), slope: pair(MOMENTS_SLOPE) }
    }
}
