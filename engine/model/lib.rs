//! Internal to beamlet: scenes, materials, spectra, spots and optics.

pub mod material;
pub mod media;
pub mod microstructure;
pub mod optics;
pub mod scene;
pub mod spectrum;
pub mod spot;
