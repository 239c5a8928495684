//! Retrieval from stacks: fits, maps, and the verbs `retrieve` and `compare`.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stdout,
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    reason = "a test that cannot go on has failed; numbers of tests are small, and its figures are printed"
)]

use beamlet_reference as reference;
#[path = "../support/mod.rs"]
mod support;

#[cfg(feature = "cli")]
mod astra;
mod correct;
mod dark_field;
mod defaults;
mod designs;
#[cfg(feature = "cli")]
mod dithers;
mod expected;
mod fibres_by_waves;
mod fits;
mod flats;
mod geometry_file;
mod groups;
mod ideal;
mod lab_faults;
mod lab_values;
mod leaking_masks;
#[cfg(feature = "cli")]
mod measured;
mod misfit;
mod noise;
#[cfg(feature = "cli")]
mod provenance;
#[cfg(feature = "cli")]
mod published;
mod retrieval;
#[cfg(feature = "cli")]
mod retrieve_cli;
#[cfg(feature = "cli")]
mod retrieve_counts;
#[cfg(feature = "cli")]
mod retrieve_stacks;
mod retrieved;
mod rough_fibres;
mod sample_scores;
#[cfg(feature = "cli")]
mod selection;
#[cfg(feature = "cli")]
mod simulated_planes;
mod solutions;
mod stacks;
mod tracking;
#[cfg(feature = "cli")]
mod two_directions;
mod uneven;
mod wedge_by_waves;
