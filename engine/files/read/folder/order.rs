//! The order of the files of a folder: by all numbers in their names, the first one first.
//!
//! Numbers that several names share count steps within views: then every combination is there, the
//! last number changes fastest. Numbers that follow from another (a date, an angle beside the number
//! of the view) make no side of their own. A side of whole numbers has no gaps. A running number that
//! differs in all names gives their order where the first number does not. Where numbers would be missing, a time
//! of day, with its date, is one value.

use super::name::{Column, columns, shown};
use super::time::with_time;
use beamlet_core::{Error, Result};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Files in order.
#[derive(Debug)]
pub(super) struct Order {
    pub(super) paths: Vec<PathBuf>,
    /// Counts of different numbers, with the number of files as their product; the last changes fastest.
    pub(crate) sides: Vec<usize>,
}

/// Columns of numbers that follow from one another: one side of the frames.
#[derive(Debug)]
struct Side {
    /// Places of the columns, the one that counts first.
    columns: Vec<usize>,
    size: usize,
}

/// Files or folders of `folder` in the order of the numbers in their names; where none has a number,
/// by their letters.
///
/// # Errors
/// [`Error::File`] where names differ in more than their numbers or agree in all of them, and where a number or
/// a combination of numbers is missing.
pub(super) fn in_order(folder: &Path, mut paths: Vec<PathBuf>) -> Result<Order> {
    // The result does not depend on the order in which the system lists files.
    paths.sort();
    let columns = columns(folder, &paths)?;
    let count = paths.len();
    if columns.is_empty() {
        return Ok(Order { paths, sides: vec![count] });
    }
    let key = |file: usize| columns.iter().map(|column| column.values[file]).collect::<Vec<_>>();
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by_cached_key(|file| key(*file));
    if let Some(pair) = order.windows(2).find(|pair| key(pair[0]) == key(pair[1])) {
        let [first, second] = [pair[0], pair[1]].map(|file| shown(&paths[file]));
        let problem = format!("holds {first} and {second}, whose numbers are the same");
        return Err(Error::file(folder, problem, None));
    }
    let timed = with_time(&columns);
    let sides = match (whole(folder, &paths, &columns, &order), &timed) {
        (Err(_), Some(timed)) => whole(folder, &paths, timed, &order)?,
        (found, _) => found?,
    };
    if sides.len() == 1 {
        one_order(folder, timed.as_deref().unwrap_or(&columns), &mut order);
    }
    let sides = sides.iter().map(|side| side.size).collect();
    Ok(Order { paths: order.into_iter().map(|file| paths[file].clone()).collect(), sides })
}

/// The sides of files in an order, of which none is missing.
fn whole(
    folder: &Path,
    paths: &[PathBuf],
    columns: &[Column],
    order: &[usize],
) -> Result<Vec<Side>> {
    let sides = sides(columns, order.len());
    refuse_missing(folder, columns, &sides, order)?;
    sides.iter().try_for_each(|side| refuse_gaps(paths, columns, side, order))?;
    Ok(sides)
}

/// Compares the order of the files with the order of each number that differs in all names. A running number
/// gives the order where the first number does not differ in all names; else a warning says so.
fn one_order(folder: &Path, columns: &[Column], order: &mut [usize]) {
    let is_unique = |column: &Column| different(column.values.iter()) == column.values.len();
    let is_ascending = |column: &Column| order.is_sorted_by_key(|file| column.values[*file]);
    let own = || columns.iter().filter(|column| different(column.values.iter()) > 1);
    let Some(other) = own().find(|column| is_unique(column) && !is_ascending(column)) else {
        return;
    };
    let runs = |column: &&Column| {
        is_unique(column)
            && !column.measures
            && column.decimals == 0
            && gap(column, order).is_none()
    };
    let running = own().find(runs).filter(|_| !own().next().is_some_and(is_unique));
    if let Some(running) = running {
        order.sort_by_key(|file| running.values[*file]);
        return;
    }
    let shown: Vec<String> =
        order.iter().take(4).map(|file| other.shown(other.values[*file])).collect();
    log::warn!(
        "{}: the numbers in the names have two orders; frames are read in that of the first number, in which \
         another one is {}, ...",
        folder.display(),
        shown.join(", ")
    );
}

/// Number of different values.
fn different<T: Ord>(values: impl Iterator<Item = T>) -> usize {
    values.collect::<BTreeSet<T>>().len()
}

/// The sides of the frames; of a single file, one of one frame.
fn sides(columns: &[Column], count: usize) -> Vec<Side> {
    let mut sides: Vec<Side> = Vec::new();
    for (place, column) in columns.iter().enumerate() {
        let size = different(column.values.iter());
        if size > 1 {
            sides.push(Side { columns: vec![place], size });
        }
    }
    // Those that follow from another side are a part of it.
    let mut at = 0;
    while at < sides.len() {
        let values = |side: &Side| &columns[side.columns[0]].values;
        let leads = |other: usize| {
            let pairs = values(&sides[at]).iter().zip(values(&sides[other]));
            other != at && different(pairs) == sides[other].size
        };
        // Of two that follow from each other the first counts.
        let leader = (0..sides.len())
            .find(|other| leads(*other) && (sides[*other].size > sides[at].size || *other < at));
        match leader {
            None => at += 1,
            Some(leader) => {
                let follower = sides[at].columns.clone();
                sides[leader].columns.extend(follower);
                sides.remove(at);
            }
        }
    }
    if sides.is_empty() {
        sides.push(Side { columns: Vec::new(), size: count });
    }
    sides
}

/// Refuses files that do not have every combination of the sides' numbers, or not in their order.
fn refuse_missing(
    folder: &Path,
    columns: &[Column],
    sides: &[Side],
    order: &[usize],
) -> Result<()> {
    if sides.len() < 2 {
        return Ok(());
    }
    let ranked: Vec<(&Column, BTreeMap<i128, usize>)> = sides
        .iter()
        .map(|side| {
            let column = &columns[side.columns[0]];
            let values: BTreeSet<i128> = column.values.iter().copied().collect();
            (column, values.into_iter().zip(0..).collect())
        })
        .collect();
    let places: Vec<usize> = order
        .iter()
        .map(|file| {
            ranked.iter().fold(0_usize, |place, (column, ranks)| {
                place.saturating_mul(ranks.len()).saturating_add(ranks[&column.values[*file]])
            })
        })
        .collect();
    let complete = sides.iter().try_fold(1_usize, |all, side| all.checked_mul(side.size));
    if complete != Some(places.len()) {
        let there: BTreeSet<usize> = places.iter().copied().collect();
        let mut rest = (0..there.len()).find(|place| !there.contains(place)).unwrap_or(there.len());
        let mut numbers: Vec<String> = Vec::new();
        for (column, ranks) in ranked.iter().rev() {
            let value = ranks.keys().nth(rest % ranks.len()).copied().unwrap_or_default();
            numbers.push(column.shown(value));
            rest /= ranks.len();
        }
        numbers.reverse();
        let sizes: Vec<String> = sides.iter().map(|side| side.size.to_string()).collect();
        let problem = format!(
            "holds {} frames whose names have {} different numbers; the one with the numbers {} is \
             missing",
            places.len(),
            sizes.join(" x "),
            numbers.join(", ")
        );
        return Err(Error::file(folder, problem, None));
    }
    if places.is_sorted() {
        return Ok(());
    }
    let problem = "holds frames whose names have numbers of views and steps in several orders; allowed: \
                   the number of the view first, then that of the step";
    Err(Error::file(folder, problem, None))
}

/// Refuses a side of whole numbers of which some are missing.
fn refuse_gaps(paths: &[PathBuf], columns: &[Column], side: &Side, order: &[usize]) -> Result<()> {
    let whole = |place: &&usize| {
        let column = &columns[**place];
        column.decimals == 0 && !column.measures && different(column.values.iter()) == side.size
    };
    let mut least: Option<Gap> = None;
    for place in side.columns.iter().filter(whole) {
        let Some(gap) = gap(&columns[*place], order) else { return Ok(()) };
        if least.as_ref().is_none_or(|other| gap.missing < other.missing) {
            least = Some(gap);
        }
    }
    let Some(Gap { files, number, .. }) = least else { return Ok(()) };
    let [before, after] = files.map(|file| &paths[file]);
    let problem = format!("is followed by {}: number {number} is missing", shown(after));
    Err(Error::file(before, problem, None))
}

/// A gap in a series of whole numbers.
struct Gap {
    /// Numbers that are missing from the whole series.
    missing: i128,
    /// Files before and behind the first gap.
    files: [usize; 2],
    /// The first number that is missing.
    number: i128,
}

/// The first gap of a column: where its values are farther apart than the closest two.
fn gap(column: &Column, order: &[usize]) -> Option<Gap> {
    let mut first: BTreeMap<i128, usize> = BTreeMap::new();
    for file in order {
        first.entry(column.values[*file]).or_insert(*file);
    }
    if first.len() < 3 {
        return None;
    }
    let pairs = || first.iter().zip(first.iter().skip(1));
    let least = pairs().map(|((a, _), (b, _))| b - a).min()?;
    let ((low, before), (_, after)) = pairs().find(|((a, _), (b, _))| *b - *a != least)?;
    let (start, end) = (first.keys().next()?, first.keys().next_back()?);
    Some(Gap {
        missing: (end - start) / least + 1 - i128::try_from(first.len()).unwrap_or(i128::MAX),
        files: [*before, *after],
        number: low + least,
    })
}
