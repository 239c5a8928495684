//! Materials of bodies at random places: their loss of contrast by wave optics (docs/physics.md, "Microstructure").
//!
//! - `hard_spheres`: how spheres that do not overlap lie to one another; `pairs`: the same from a table;
//! - `loss`: loss of contrast per path length at a shear;
//! - `set_up`: shears of a scene;
//! - `medium`: a material of a scene, as a variance of the refraction angle per path length;
//! - `description`: the same in words, with warnings.

mod description;
mod hard_spheres;
mod loss;
mod medium;
mod pairs;
mod set_up;

pub use description::Description;
pub use loss::{Bodies, FLUID, Loss};
pub use medium::{Medium, variances};
pub use set_up::SetUp;
