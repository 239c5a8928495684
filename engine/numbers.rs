//! Casts between kinds of numbers, checked: the place where their lints are off.

#![expect(clippy::cast_possible_truncation, reason = "every cast here is bounded before it")]

/// A count or index of what is held below 2^32 where it is read: triangles and objects by
/// `geometry`, rays by their batches, frames and their sides by scene and stack.
///
/// # Panics
/// From 2^32 on: a bound was forgotten, and what is numbered would be taken for something else.
#[track_caller]
pub(crate) const fn count(n: usize) -> u32 {
    assert!(n <= u32::MAX as usize, "more than 32 bits can count");
    n as u32
}

/// A count that bounds others: as many as 32 bits can count where it is more.
pub(crate) fn at_most(n: usize) -> u32 {
    n.min(u32::MAX as usize) as u32
}

/// Bytes as a length in memory, or the longest where they are more than an address can tell.
pub(crate) fn length(bytes: u64) -> usize {
    usize::try_from(bytes).unwrap_or(usize::MAX)
}

/// The nearest f32.
pub(crate) const fn single(value: f64) -> f32 {
    value as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_whole_or_refused_and_bounds_end() {
        assert_eq!((count(0), count(u32::MAX as usize)), (0, u32::MAX));
        assert_eq!(at_most(1 << 40), u32::MAX);
        assert!(std::panic::catch_unwind(|| count(1 << 32)).is_err());
    }
}
