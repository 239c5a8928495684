//! `beamlet schema`: the JSON Schema of scene files, on stdout.

use crate::failure::Failure;
use beamlet::cli_support::json_schema;
use std::io::Write;

pub(super) fn run(out: &mut impl Write) -> Result<(), Failure> {
    super::write_json(&json_schema(), out)
}
