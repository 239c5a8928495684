//! Scenes, materials, spectra, spots and optics of beamlet.

pub mod material;
pub mod media;
pub mod optics;
pub mod scene;
pub mod spectrum;
pub mod spot;
