//! Parts of a run: consecutive views with their flats and darks, made by a process of its own.

use super::shape::{StackShape, views};
use beamlet_core::{Error, Result, numbers};
use beamlet_model::scene::{Exposure, Scene};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::Range;

/// Consecutive views with the sample, from `first` up to `end`, which is not one of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ViewRange {
    /// The first view, from 0.
    pub first: u32,
    /// The view behind the last.
    pub end: u32,
}

impl ViewRange {
    /// The views from `first` up to `end`.
    ///
    /// # Errors
    /// [`Error::Argument`] where `first` is not below `end`.
    pub fn new(first: u32, end: u32) -> Result<Self> {
        if first >= end {
            let allowed = "A..B with A below B: the views A to B - 1, from 0";
            return Err(Error::argument("views", format!("{first}..{end}"), allowed));
        }
        Ok(Self { first, end })
    }
}

impl fmt::Display for ViewRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}..{}", self.first, self.end)
    }
}

impl std::str::FromStr for ViewRange {
    type Err = Error;

    /// Reads `A..B`.
    fn from_str(text: &str) -> Result<Self> {
        let numbers = text
            .split_once("..")
            .and_then(|(first, end)| Some((first.trim().parse().ok()?, end.trim().parse().ok()?)));
        match numbers {
            Some((first, end)) => Self::new(first, end),
            None => {
                let allowed = "A..B, as in 0..90: the views A to B - 1, from 0";
                Err(Error::argument("views", text, allowed))
            }
        }
    }
}

/// The part of the stacks of a run that one folder holds.
#[derive(Debug, Clone, Copy)]
pub(super) struct Part {
    /// Shape of the stacks of the whole run.
    pub(super) extent: StackShape,
    samples: ViewRange,
    /// Flats before these views; one behind the last view of the run belongs to that view.
    flats: ViewRange,
    darks: ViewRange,
}

impl Part {
    /// The part of a run of `scene` with these views; `None`: all of it.
    ///
    /// # Errors
    /// [`Error::Argument`] where the scene has fewer views; as [`StackShape::of`].
    pub(super) fn of(scene: &Scene, samples: Option<ViewRange>) -> Result<Self> {
        let extent = StackShape::of(scene)?;
        let samples = samples.unwrap_or(ViewRange { first: 0, end: extent.views });
        if samples.end > extent.views {
            let allowed = format!("views of the scan, 0..{} at most", extent.views);
            return Err(Error::argument("views", samples.to_string(), allowed));
        }
        let last = extent.views.saturating_sub(1);
        let among = |places: &[u32]| {
            let before = |view| places.partition_point(|place| (*place).min(last) < view);
            let [first, end] = [samples.first, samples.end].map(before).map(numbers::count);
            ViewRange { first, end }
        };
        let [flats, darks] = [scene.scan.flat_places(), scene.scan.dark_places()];
        Ok(Self { extent, samples, flats: among(&flats), darks: among(&darks) })
    }

    /// Indices of its views in the stack of a view.
    pub(crate) const fn range(&self, view: Exposure) -> Range<u32> {
        let ViewRange { first, end } = match view {
            Exposure::Sample(_) => self.samples,
            Exposure::Flat(_) => self.flats,
            Exposure::Dark(_) => self.darks,
        };
        first..end
    }

    /// True if a view belongs to it.
    pub(crate) fn has(&self, view: Exposure) -> bool {
        self.range(view).contains(&view.index())
    }
}

/// Every view of a run of `scene`, or of a part of it, in the order of time.
///
/// # Errors
/// [`Error::Argument`] where the scene has fewer views; as [`StackShape::of`].
#[doc(hidden)]
pub fn views_of_part(scene: &Scene, part: Option<ViewRange>) -> Result<Vec<Exposure>> {
    let part = Part::of(scene, part)?;
    Ok(views(scene)?.filter(|view| part.has(*view)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_ranges_or_say_what_is_allowed() {
        assert_eq!("3..8".parse::<ViewRange>().unwrap(), ViewRange { first: 3, end: 8 });
        for text in ["8..8", "9..8", "1", "-1..8", "a..8", "..8", "0..=8"] {
            let message = text.parse::<ViewRange>().unwrap_err().to_string();
            assert!(message.contains("A..B"), "{text}: {message}");
        }
    }
}
