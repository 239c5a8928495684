//! Waves in f64: numerical propagation of fields along x, by none of the formulas of pairs of rays.
//!
//! Paraxial, thin masks, a thin sample (projection approximation). Fields are `exp(ikz)` waves without
//! the spherical phase of a source on the axis, in coordinates of the plane of the sample mask: a place
//! of another plane is seen from the source through its place there. Free space from the distance y₁ to
//! y₂ then is the transfer function exp(−iπλ f² z₁² (1/y₁ − 1/y₂)), z₁ the distance of the mask.
//!
//! In the order of the data flow:
//! - `setup.rs`: distances, focal spot, slits and windows
//! - `body.rs`: path lengths of cylinders and slabs
//! - `field.rs`: grids and propagation by FFT
//! - `light.rs`: blur by the spot, light of windows, curves
//! - `block.rs`: fields through a thick block, step by step
//! - `plane.rs`: fields of two dimensions, for spheres
//! - `row.rs`: pixels of a row, as a detector has them
//! - `rays.rs`: the same curves by rays
//! - `fresnel.rs`: Fresnel integrals of slits, a second method

pub mod block;
pub mod body;
pub mod field;
pub mod fresnel;
pub mod light;
pub mod plane;
pub mod rays;
pub mod row;
pub mod setup;

#[cfg(test)]
mod tests;
