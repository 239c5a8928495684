//! Runs of cases.

use super::case::Case;
use super::compare::{Difference, flat_of, largest};
use super::relations::Relation;
use super::support::{Checked, engine, engine_of, leftovers};
use beamlet::stack::Stacks;
use beamlet::{Backend, EngineOptions, RunRecord};
use ndarray::Array4;
use std::path::PathBuf;

/// Stacks and record of a case.
pub(crate) struct Run {
    flat: Array4<f32>,
    pub(crate) sample: Array4<f32>,
    pub(crate) record: RunRecord,
}

impl Run {
    /// Largest change that the sample makes, share of open beam.
    pub(crate) fn contrast(&self) -> f32 {
        (&self.sample - &self.flat).iter().fold(0.0, |most, it| it.abs().max(most))
    }
}

/// An engine that makes rows one by one, with few rays at a time.
fn in_bands() -> Checked {
    let options = EngineOptions::default().with_backend(Backend::Bvh);
    engine_of(options.with_band_rows(Some(1)).with_batch_rays(Some(257)))
}

/// Folder of the places of instances.
pub(crate) fn folder() -> PathBuf {
    let folder = leftovers().join("metamorphic");
    std::fs::create_dir_all(&folder).expect("a folder for the places of instances");
    folder
}

/// Runs a case. An error, and rays that were lost, are texts.
pub(crate) fn run(case: &Case, backend: Backend) -> Result<Run, String> {
    run_on(&engine(backend), case)
}

fn run_on(engine: &Checked, case: &Case) -> Result<Run, String> {
    let scene = case.written(&folder(), &format!("{:?}", std::thread::current().id()));
    checked(engine.simulate(&scene).map_err(|error| error.to_string())?)
}

/// Stacks whose rays were counted soundly.
fn checked(stacks: Stacks) -> Result<Run, String> {
    let tally = stacks.record.tally;
    if (tally.unbalanced, tally.dropped, tally.not_finite) != (0, 0, 0) {
        return Err(format!("rays were lost: {tally:?}"));
    }
    if tally.reflected.max(tally.retraced) > tally.rays + tally.exact {
        return Err(format!("more rays than there are: {tally:?}"));
    }
    Ok(Run { flat: flat_of(&stacks), sample: stacks.sample, record: stacks.record })
}

/// The largest difference, by its limit, between a case whose run is given and the changed case;
/// nothing where the relation does not change it.
pub(crate) fn difference(
    relation: Relation,
    case: &Case,
    first: &Run,
) -> Result<Option<Difference>, String> {
    if relation != Relation::Origin {
        return compare(relation, case, first);
    }
    let rough = case.roughened();
    compare(relation, &rough, &run(&rough, Backend::Bvh)?)
}

fn compare(relation: Relation, case: &Case, first: &Run) -> Result<Option<Difference>, String> {
    let Some(changed) = relation.changed(case) else { return Ok(None) };
    let other = match relation {
        Relation::Bands => run_on(&in_bands(), &changed),
        _ => run(&changed, relation.backend()),
    }?;
    assert_eq!(other.record.backend, relation.backend());
    let limits = relation.limits(case, [&first.record, &other.record]);
    let (flat, sample) = (relation.restored(other.flat), relation.restored(other.sample));
    let flat = largest("flat", [&first.flat, &flat], &limits);
    let sample = largest("sample", [&first.sample, &sample], &limits);
    Ok(Some(if flat.ratio() > sample.ratio() { flat } else { sample }))
}
