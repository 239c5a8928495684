//! Values at which a camera stops counting: the largest of a stack, in many pixels.

use ndarray::{Array3, Axis};
use std::sync::{Mutex, PoisonError};

/// Fewest values at the largest one, and their number over that of the next largest one, which noise does not reach.
const FEWEST: u64 = 16;
const RATIO: u64 = 4;

/// The two largest values of a stack as its files have them, each with its number.
#[derive(Debug, Default)]
pub(super) struct Largest(Mutex<[Option<(f32, u64)>; 2]>);

impl Largest {
    /// Adds frames `[step][row][column]`. Pixels with one value in all steps are hot or dead.
    pub(super) fn add(&self, data: &Array3<f32>) {
        let mut own = [None; 2];
        for pixel in data.lanes(Axis(0)) {
            let first = pixel.first().copied().unwrap_or(f32::NAN);
            if pixel.iter().all(|value| value.to_bits() == first.to_bits()) {
                continue;
            }
            pixel.iter().filter(|value| value.is_finite()).for_each(|y| enter(&mut own, *y, 1));
        }
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        own.into_iter().flatten().for_each(|(value, count)| enter(&mut all, value, count));
    }

    /// The value that more of the brightest values share than noise explains, with their number: a whole number, since
    /// frames without noise have no such limit.
    pub(super) fn full_scale(&self) -> Option<(f32, u64)> {
        let [first, next] = *self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let (value, count) = first?;
        let others = next.map_or(0, |(_, count)| count);
        let is_whole = value > 1.0 && value.fract().abs() <= 0.0;
        (is_whole && others > 0 && count >= FEWEST.max(RATIO * others)).then_some((value, count))
    }
}

/// Enters `count` times a value among the two largest ones.
fn enter(largest: &mut [Option<(f32, u64)>; 2], value: f32, count: u64) {
    for at in 0..2 {
        match &mut largest[at] {
            Some((known, times)) if known.to_bits() == value.to_bits() => *times += count,
            Some((known, _)) if *known > value => continue,
            _ => {
                if at == 0 {
                    largest[1] = largest[0];
                }
                largest[at] = Some((value, count));
            }
        }
        return;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(value: impl Fn(usize, usize) -> f32) -> Option<(f32, u64)> {
        let largest = Largest::default();
        for half in 0..2 {
            largest
                .add(&Array3::from_shape_fn((4, 1, 50), |(step, _, x)| value(step, 50 * half + x)));
        }
        largest.full_scale()
    }

    /// Values of 100 pixels in two parts: cut at 4095 in two steps, not cut, the same in all pixels, and hot pixels.
    #[test]
    fn values_that_many_pixels_share_at_the_top_are_found() {
        let noisy = |step: usize, pixel: usize| (1000 * step + 37 * pixel % 91) as f32;
        assert_eq!(found(|step, pixel| noisy(2 * step, pixel).min(4095.0)), Some((4095.0, 100)));
        assert_eq!(found(noisy), None);
        assert_eq!(found(|step, _| 1000.0 * step as f32), None);
        let hot =
            |step, pixel: usize| if pixel.is_multiple_of(5) { 65535.0 } else { noisy(step, pixel) };
        assert_eq!(found(hot), None);
    }
}
