//! How far a packing is: its work as a whole, of which phases are parts.

use beamlet_core::watch::Task;
use beamlet_core::{Result, numbers};

/// All work of a packing, as its steps report it.
pub(super) const ALL: u64 = 10_000;

/// The part of a packing's work that a phase is.
#[derive(Clone, Copy)]
pub(super) struct Share<'a> {
    task: Task<'a>,
    /// Where it begins and ends, of all work.
    ends: [f64; 2],
}

impl<'a> Share<'a> {
    pub(super) const fn whole(task: Task<'a>) -> Self {
        Self { task, ends: [0.0, 1.0] }
    }

    /// Part between two places of this part, from 0 to 1.
    pub(super) fn part(self, places: [f64; 2]) -> Self {
        Self { ends: places.map(|place| self.at(place)), ..self }
    }

    fn at(self, place: f64) -> f64 {
        let [begin, end] = self.ends;
        begin + (end - begin) * place.clamp(0.0, 1.0)
    }

    /// It came to this place, from 0 to 1; never goes back.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Interrupted`] where it shall stop.
    pub(super) fn reach(self, place: f64) -> Result<()> {
        self.task.reach_at_least(numbers::whole((self.at(place) * ALL as f64).floor()));
        self.task.check()
    }
}
