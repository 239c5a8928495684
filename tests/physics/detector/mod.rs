//! The detector: blur against double integrals in f64, statistics of the counts, response,
//! scatter, and what of it is refused.

#![allow(
    clippy::unwrap_used,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a test that cannot go on has failed; sizes are small"
)]

mod blur;
mod kernel_file;
mod keys;
mod reproducible;
mod response;
mod scatter;
mod statistics;
pub(crate) mod z_test;
