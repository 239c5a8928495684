//! `beamlet schema`: the JSON Schema of scene files, on stdout.

use crate::failure::Failure;
use beamlet::scene::json_schema;
use std::io::Write;

pub(super) fn run(out: &mut impl Write) -> Result<(), Failure> {
    super::write_json(&json_schema(), out)
}
