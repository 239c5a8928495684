//! Errors that sampling leaves, against stacks of the same meshes from about a hundred times the
//! rays, each followed in order, without sums over facets (docs/developers/validation.md, "Truth").

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::print_stdout,
    reason = "sizes are small; measured figures are what this is for"
)]

mod cases;
mod classes;
mod errors;
mod held;
mod leaks;
mod shifts;
mod tables;
