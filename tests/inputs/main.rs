//! What is read before a device is opened: scenes, meshes, materials and spectra; and the layers of the
//! engine. None of these tests needs a Vulkan device.

#![allow(
    clippy::unwrap_used,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "a test that cannot go on has failed; numbers of tests are small, and its figures are printed"
)]

mod crates;
mod documents;
mod exposure;
#[allow(dead_code, unreachable_pub, reason = "fuzz targets use the rest")]
#[path = "../fuzz/support/lib.rs"]
mod fuzz;
mod garbage;
mod geometry;
mod instances;
mod kept;
mod material;
mod names;
mod option_docs;
mod paper;
mod patterns;
mod scan;
mod scene;
mod scene_beam;
mod scene_docs;
mod scene_resolved;
mod scene_shapes;
mod spectrum_files;
mod spectrum_nodes;
mod spectrum_tube;
mod surroundings;
