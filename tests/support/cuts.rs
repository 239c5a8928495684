//! Runs that are cut into bands, batches, little memory and other numbers of threads: results do not depend on it.

use super::engine_of;
use beamlet::scene::Scene;
use beamlet::stack::Stacks;
use beamlet::{Backend, EngineOptions};

/// A way to cut a run; `None` leaves the default of the engine.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Cut {
    /// Rows of a band.
    pub(crate) band: Option<u32>,
    /// Rays of a dispatch.
    pub(crate) batch: Option<u32>,
    /// Limit of the memory, bytes.
    pub(crate) memory: Option<u64>,
    /// Threads of the host.
    pub(crate) threads: Option<usize>,
}

/// Bands of so many rows, and the default of all else.
pub(crate) const fn bands(rows: u32) -> Cut {
    Cut { band: Some(rows), batch: None, memory: None, threads: None }
}

/// Dispatches of so many rays, and the default of all else.
pub(crate) const fn batches(rays: u32) -> Cut {
    Cut { band: None, batch: Some(rays), memory: None, threads: None }
}

impl Cut {
    fn run(self, scene: &Scene) -> Stacks {
        let options = EngineOptions::default()
            .with_backend(Backend::Bvh)
            .with_band_rows(self.band)
            .with_batch_rays(self.batch)
            .with_memory_limit(self.memory);
        let run = || engine_of(options).simulate(scene).expect("a stack");
        let Some(threads) = self.threads else { return run() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads").install(run)
    }
}

/// Light and counts of all frames, as bits.
fn bits(stacks: &Stacks) -> Vec<u32> {
    let light = stacks.flat.iter().chain(&stacks.later_flats).chain(&stacks.sample);
    let counts = stacks.counts.iter().flat_map(|counts| {
        let later = counts.later_flats.iter().chain(&counts.later_darks);
        counts.flat.iter().chain(&counts.sample).chain(&counts.dark).chain(later)
    });
    light.chain(counts).map(|value| value.to_bits()).collect()
}

/// Fails where a bit of light or counts, or a sum of an audit, differs between the whole run of a scene and one that is
/// cut; returns the whole run.
#[track_caller]
pub(crate) fn no_bit_changes(name: &str, scene: &Scene, cuts: &[Cut]) -> Stacks {
    let whole = Cut::default().run(scene);
    assert!(whole.sample.iter().any(|value| *value > 0.0), "{name}: no light");
    let want = bits(&whole);
    for cut in cuts {
        let other = cut.run(scene);
        let got = bits(&other);
        let first = want.iter().zip(&got).position(|(a, b)| a != b);
        assert!(first.is_none() && got.len() == want.len(), "{name}, {cut:?}: value {first:?}");
        let [a, b] = [&whole, &other].map(|it| &it.record.tally);
        assert_eq!(
            [a.saturated, a.grazing_light],
            [b.saturated, b.grazing_light],
            "{name}, {cut:?}"
        );
        assert_eq!(a.audit, b.audit, "{name}, {cut:?}");
    }
    whole
}
