//! Flags of the pixels of a view: trusted pixels for scales, and counts in words.

use super::Subject;
use crate::failure::Failure;
use crate::numbers;
use crate::picture::scale::pixels;
use ndarray::Array2;

/// Flags of a view.
#[derive(Debug, Clone)]
pub(crate) struct Flags {
    pub(crate) bits: Array2<u32>,
    /// Whether any bit is set.
    pub(crate) flagged: Array2<bool>,
}

/// Pixels that may set a scale: pixels without a flag. `None`, all of them, if more than half is flagged:
/// flags do not distinguish good pixels then.
pub(crate) fn trusted<'a, I>(flagged: I) -> Option<Vec<bool>>
where
    I: IntoIterator<Item = &'a bool>,
{
    let trusted: Vec<bool> = flagged.into_iter().map(|flagged| !flagged).collect();
    let count = trusted.iter().filter(|trusted| **trusted).count();
    (2 * count >= trusted.len()).then_some(trusted)
}

impl Subject {
    /// Flags of a view; `None` where there are none.
    pub(crate) fn flags(&self, view: usize) -> Result<Option<Flags>, Failure> {
        if !self.has("flags") {
            return Ok(None);
        }
        let bits = self.map("flags", view)?.mapv(|bits| numbers::whole::<u32>(f64::from(bits)));
        let flagged = bits.mapv(|bits| bits != 0);
        Ok(Some(Flags { bits, flagged }))
    }

    /// How many pixels are flagged, and why, in words; empty where none is.
    pub(crate) fn words_of_flags(&self, flags: &Flags) -> String {
        let count = flags.flagged.iter().filter(|flagged| **flagged).count();
        if count == 0 {
            return String::new();
        }
        let meanings = self.record().into_iter().flat_map(|record| &record.flags);
        let named = meanings.filter_map(|(bit, meaning)| {
            let count = flags.bits.iter().filter(|bits| *bits & bit != 0).count();
            let name = meaning.split(':').next().unwrap_or(meaning).replace('_', "-");
            (count > 0).then(|| format!("{} {name}", beamlet::cli_support::count(count as u64)))
        });
        let named: Vec<String> = named.collect();
        let all = beamlet::cli_support::count(flags.flagged.len() as u64);
        let reasons =
            if named.is_empty() { String::new() } else { format!(": {}", named.join(", ")) };
        format!("flagged: {} of {all}{reasons}", pixels(count))
    }
}
