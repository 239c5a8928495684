//! Casts between kinds of numbers: the only place where their lints are off.

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "every cast here is bounded before it, or does what its function says"
)]

/// A count or index that its reader keeps below 2^32: triangles and objects by `geometry`, rays by their
/// batches, frames and their sides by scene and stack.
///
/// # Panics
/// From 2^32 on: a bound was forgotten, and an index would address another item.
#[track_caller]
pub const fn count(n: usize) -> u32 {
    assert!(n <= u32::MAX as usize, "more than 32 bits can count");
    n as u32
}

/// A count that serves as an upper bound: larger ones are the largest u32.
pub fn at_most(n: usize) -> u32 {
    n.min(u32::MAX as usize) as u32
}

/// Bytes as a length in memory, or the longest where they are more than an address can hold.
pub fn length(bytes: u64) -> usize {
    usize::try_from(bytes).unwrap_or(usize::MAX)
}

/// The nearest f32.
pub const fn single(value: f64) -> f32 {
    value as f32
}

/// The lower 32 bits.
pub const fn low_word(value: u64) -> u32 {
    value as u32
}

/// The upper 32 bits.
pub const fn high_word(value: u64) -> u32 {
    (value >> 32) as u32
}

/// The lower 64 bits.
pub const fn low_half(value: u128) -> u64 {
    value as u64
}

/// The whole part of a number, towards zero: the nearest that there is where it is out of range, 0
/// where it is not a number.
pub fn whole<T: Whole>(value: f64) -> T {
    T::of(value)
}

/// An integer as another type, which holds its value.
#[track_caller]
pub fn narrow<T>(value: impl Narrow<T>) -> T {
    value.narrow()
}

/// Integers that [`whole`] makes.
pub trait Whole {
    /// The whole part.
    fn of(value: f64) -> Self;
}

/// Integers that [`narrow`] takes.
pub trait Narrow<T> {
    /// The same value.
    fn narrow(self) -> T;
}

macro_rules! whole {
    ($($to:ty),*) => {$(
        impl Whole for $to {
            fn of(value: f64) -> Self {
                value as Self
            }
        }
    )*};
}

macro_rules! narrow {
    ($($from:ty => $to:ty),*) => {$(
        impl Narrow<$to> for $from {
            #[track_caller]
            fn narrow(self) -> $to {
                debug_assert!(<$to>::try_from(self).is_ok(), "{self} as {}", stringify!($to));
                self as $to
            }
        }
    )*};
}

whole!(i32, i64, u8, u16, u32, u64, usize);
narrow!(i64 => i32, i64 => u32, i64 => u64, i64 => usize, u64 => usize, u32 => u8);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_whole_or_refused_and_bounds_end() {
        assert_eq!((count(0), count(u32::MAX as usize)), (0, u32::MAX));
        assert_eq!(at_most(1 << 40), u32::MAX);
        assert!(std::panic::catch_unwind(|| count(1 << 32)).is_err());
    }

    #[test]
    fn whole_parts_go_towards_zero_and_end_at_the_bounds() {
        assert_eq!((whole::<i64>(-2.9), whole::<u32>(-2.9), whole::<u32>(2.9)), (-2, 0, 2));
        assert_eq!((whole::<u32>(1e30), whole::<usize>(f64::NAN)), (u32::MAX, 0));
    }

    #[test]
    fn words_are_halves() {
        let value = 0x0123_4567_89ab_cdef;
        assert_eq!((low_word(value), high_word(value)), (0x89ab_cdef, 0x0123_4567));
        assert_eq!(narrow::<u32>(7_i64), 7);
    }
}
