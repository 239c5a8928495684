//! Runs that keep their moments, and their light again.

use super::Checked;
use beamlet::moments::{MomentWriter, StoredMoments};
use beamlet::scene::Scene;
use beamlet::stack::{ArraySink, Format, RunDirectory, Stacks};
use beamlet::{Control, Result};
use std::path::Path;

/// The moments that an engine keeps of a run in a new directory.
pub(crate) fn keep(engine: &Checked, scene: &Scene, run: &Path) -> StoredMoments {
    let mut sink = RunDirectory::create(run, Format::Npy, false).expect("a directory");
    let mut keep = MomentWriter::new(run);
    engine.run(scene, &mut sink, Control::default().with_keep(&mut keep)).expect("a run");
    StoredMoments::open(run).expect("moments")
}

/// The stacks of a scene by moments that were kept.
pub(crate) fn again(engine: &Checked, kept: &StoredMoments, scene: &Scene) -> Result<Stacks> {
    let mut sink = ArraySink::new();
    engine.reilluminate(kept, scene)?.run(&mut sink, Control::default())?;
    Ok(sink.into_stacks().expect("stacks"))
}
