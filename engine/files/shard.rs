//! Shards: equal parts of the views of a run, each made by a process of its own.

use super::shape::StackShape;
use beamlet_core::{Error, Result, numbers};
use beamlet_model::scene::Exposure;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::Range;

/// Most shards of a run.
const MOST: u32 = 100_000;

/// One of `count` parts of the views of a run: consecutive views with the sample, and consecutive flats
/// and darks. One flat and one dark belong to the first part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Shard {
    /// Index of the part, from 0.
    pub index: u32,
    /// Number of parts.
    pub count: u32,
}

impl Default for Shard {
    fn default() -> Self {
        Self::WHOLE
    }
}

impl Shard {
    /// All views of a run.
    pub const WHOLE: Self = Self { index: 0, count: 1 };

    /// Part `index` of `count`.
    ///
    /// # Errors
    /// [`Error::Argument`] where `index` is not below `count`, or `count` is not in 1 to 100,000.
    pub fn new(index: u32, count: u32) -> Result<Self> {
        if !(1..=MOST).contains(&count) {
            return Err(Error::argument("shards", count.to_string(), format!("1 to {MOST}")));
        }
        if index >= count {
            let allowed = format!("0 to {} of {count} shards", count - 1);
            return Err(Error::argument("shard", index.to_string(), allowed));
        }
        Ok(Self { index, count })
    }

    /// True if this is all of a run.
    #[must_use]
    pub const fn is_whole(self) -> bool {
        self.count == 1
    }

    /// Indices of the views with the sample among `views`.
    #[must_use]
    pub fn views(self, views: u32) -> Range<u32> {
        let [views, count] = [views, self.count].map(u64::from);
        let first = |index: u32| numbers::low_word(u64::from(index) * views / count);
        first(self.index)..first(self.index + 1)
    }

    /// Indices of its flats or darks among `all`.
    fn flats(self, all: u32) -> Range<u32> {
        let [all, count] = [all, self.count].map(u64::from);
        let first = |index: u32| numbers::low_word((u64::from(index) * all).div_ceil(count));
        first(self.index)..first(self.index + 1)
    }

    /// Indices of its views in the stack of a view.
    fn range(self, view: Exposure, extent: StackShape) -> Range<u32> {
        match view {
            Exposure::Sample(_) => self.views(extent.views),
            Exposure::Flat(_) | Exposure::Dark(_) => self.flats(extent.count_of(view)),
        }
    }

    /// True if a view of a run with this extent belongs to this part.
    #[must_use]
    pub fn has(self, view: Exposure, extent: StackShape) -> bool {
        self.range(view, extent).contains(&view.index())
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

impl std::str::FromStr for Shard {
    type Err = Error;

    /// Reads `K/N`.
    fn from_str(text: &str) -> Result<Self> {
        let numbers = text.split_once('/').and_then(|(index, count)| {
            Some((index.trim().parse().ok()?, count.trim().parse().ok()?))
        });
        match numbers {
            Some((index, count)) => Self::new(index, count),
            None => Err(Error::argument("shard", text, "K/N, as in 0/8: K from 0 to N - 1")),
        }
    }
}

/// The part of the stacks of a run that one folder holds.
#[derive(Debug, Clone, Copy)]
pub(super) struct Part {
    /// Shape of the stacks of the whole run.
    pub(super) extent: StackShape,
    pub(super) shard: Shard,
}

impl Part {
    /// All of a run.
    pub(super) const fn whole(extent: StackShape) -> Self {
        Self { extent, shard: Shard::WHOLE }
    }

    /// Indices of its views in the stack of a view.
    pub(crate) fn range(&self, view: Exposure) -> Range<u32> {
        self.shard.range(view, self.extent)
    }

    /// True if its views come before a view of the run, in the stack of the view.
    pub(super) fn is_before(&self, view: Exposure) -> bool {
        self.range(view).end <= view.index()
    }

    /// True if a view belongs to it.
    pub(crate) fn has(&self, view: Exposure) -> bool {
        self.shard.has(view, self.extent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_cover_every_view_once() {
        for (views, count) in [(7, 3), (1, 1), (360, 7), (5, 5), (1_000_000, 100_000)] {
            let mut next = 0;
            for index in 0..count {
                let range = Shard::new(index, count).unwrap().views(views);
                assert_eq!(range.start, next);
                assert!(!range.is_empty(), "shard {index} of {count} of {views} views");
                next = range.end;
            }
            assert_eq!(next, views);
        }
        let flats = |all: u32| [0, 1, 2].map(|index| Shard { index, count: 3 }.flats(all));
        assert_eq!(flats(1), [0..1, 1..1, 1..1]);
        assert_eq!(flats(4), [0..2, 2..3, 3..4]);
    }

    #[test]
    fn words_are_shards_or_say_what_is_allowed() {
        assert_eq!("3/8".parse::<Shard>().unwrap(), Shard { index: 3, count: 8 });
        for (text, allowed) in [
            ("8/8", "0 to 7 of 8 shards"),
            ("0/0", "1 to 100000"),
            ("1", "K/N"),
            ("-1/8", "K/N"),
            ("a/8", "K/N"),
        ] {
            let message = text.parse::<Shard>().unwrap_err().to_string();
            assert!(message.contains(allowed), "{text}: {message}");
        }
    }
}
