//! The program as a user sees it: verbs, messages, pictures and reports.

#![allow(
    clippy::unwrap_used,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a test that cannot go on has failed; numbers of tests are small, and its figures are printed"
)]

#[path = "../support/mod.rs"]
mod support;

mod advice;
mod answers;
mod assemblies;
mod cli;
mod cli_beam;
mod clipping;
mod doubts;
mod experiment;
mod hostile_meshes;
mod iterated;
mod mesh;
mod mistakes;
mod pictures;
mod quality;
mod refusals;
mod report;
mod screw;
mod sweep;
mod view;
mod volume_report;
mod waves;
