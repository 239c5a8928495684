//! What is on disk: stacks as they are written and read, runs that were ended, damaged or
//! made by others, and inputs at the ends of what is allowed.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stdout,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a test that cannot go on has failed; numbers of tests are small, and its figures are printed"
)]

#[path = "../support/mod.rs"]
mod support;

mod big_input;
mod big_tiff;
#[cfg(all(feature = "cli", target_os = "linux"))]
mod crash;
#[cfg(feature = "cli")]
mod endless;
mod ends;
#[cfg(all(feature = "cli", unix))]
mod flats;
mod frame_order;
mod integrity;
mod kills;
mod one_patch;
#[cfg(all(feature = "cli", unix))]
mod parts;
mod safety;
mod stack;
mod stack_read;
mod tiff_pages;
#[cfg(feature = "cli")]
mod tiff_stacks;
#[cfg(feature = "cli")]
mod tiny_runs;
mod views;
