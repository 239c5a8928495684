//! Flags of the pixels of a view: what they mean for scales, and their counts in words.

use super::Subject;
use crate::failure::Failure;
use crate::numbers;
use crate::picture::scale::pixels;
use ndarray::Array2;

/// Where more than this share of the pixels with an answer is flagged, flags tell nothing of what
/// to trust, and all pixels set the scale.
const MOST: f64 = 0.5;

/// Flags of a view.
#[derive(Debug, Clone)]
pub(crate) struct Flags {
    pub(crate) bits: Array2<u32>,
    /// Whether any bit is set.
    pub(crate) flagged: Array2<bool>,
}

impl Flags {
    /// Whether a pixel may set a scale.
    pub(crate) fn sets_scale(&self) -> Array2<bool> {
        let count = self.flagged.iter().filter(|flagged| **flagged).count();
        match count as f64 > MOST * self.flagged.len() as f64 {
            true => self.flagged.mapv(|_| true),
            false => self.flagged.mapv(|flagged| !flagged),
        }
    }
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

    /// How many pixels are flagged, and why, in words; empty where none is. `sign`: how they look.
    pub(crate) fn words_of_flags(&self, flags: &Flags, sign: &str) -> String {
        let count = flags.flagged.iter().filter(|flagged| **flagged).count();
        if count == 0 {
            return String::new();
        }
        let meanings = self.record().into_iter().flat_map(|record| &record.flags);
        let named = meanings.filter_map(|(bit, meaning)| {
            let count = flags.bits.iter().filter(|bits| *bits & bit != 0).count();
            let name = meaning.split(':').next().unwrap_or(meaning).replace('_', "-");
            (count > 0).then(|| format!("{} {name}", beamlet::check::count(count as u64)))
        });
        let named: Vec<String> = named.collect();
        let all = beamlet::check::count(flags.flagged.len() as u64);
        let reasons =
            if named.is_empty() { String::new() } else { format!(": {}", named.join(", ")) };
        format!("flagged{sign}: {} of {all}{reasons}", pixels(count))
    }
}
