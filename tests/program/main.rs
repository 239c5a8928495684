//! The program as a user sees it: verbs, messages, pictures and reports.

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
mod view;
mod volume_report;
mod waves;
