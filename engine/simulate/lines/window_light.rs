//! Light of a line by the windows that it passes.

use std::ops::Range;

/// Light in windows of one beamlet, of each kind and mask step. It has no values for windows before the first and after
/// the last that get light: few do, but refraction takes light to any.
#[derive(Debug, Clone, Default)]
pub(crate) struct WindowLight {
    /// Number of the first window.
    first: i64,
    /// Values of a window: kinds times mask steps.
    each: usize,
    values: Vec<f32>,
}

impl WindowLight {
    /// No light; `each`: values of a window.
    pub(super) const fn new(each: usize) -> Self {
        Self { first: 0, each, values: Vec::new() }
    }

    /// Values of the windows of each of some lights, one light after another.
    pub(super) fn join(parts: &[Self]) -> Self {
        let each = parts.iter().map(|part| part.each).sum();
        let numbers = parts.iter().flat_map(|part| part.windows().map(|(number, _)| number));
        let ends = numbers.fold(None, |ends: Option<[i64; 2]>, number| {
            let [low, high] = ends.unwrap_or([number; 2]);
            Some([low.min(number), high.max(number)])
        });
        let mut joined = Self::new(each);
        let Some([low, high]) = ends else { return joined };
        joined.window(low);
        joined.window(high);
        let mut before = 0;
        for part in parts {
            for (number, values) in part.windows() {
                let own = &mut joined.window(number)[before..before + part.each];
                own.copy_from_slice(values);
            }
            before += part.each;
        }
        joined
    }

    /// Values by window, kind and mask step.
    pub(super) fn values(&self) -> Values<'_> {
        Values { first: self.first * self.each as i64, values: &self.values }
    }

    /// Bytes of the values.
    pub(super) const fn bytes(&self) -> usize {
        self.values.capacity() * size_of::<f32>()
    }

    /// Values of a window, by kind and mask step.
    pub(super) fn window(&mut self, number: i64) -> &mut [f32] {
        if self.values.is_empty() {
            self.first = number;
        }
        let before = usize::try_from(self.first - number).unwrap_or(0);
        if before > 0 {
            self.values.splice(0..0, std::iter::repeat_n(0.0, before * self.each));
            self.first = number;
        }
        let at = usize::try_from(number - self.first).unwrap_or(0) * self.each;
        self.values.resize(self.values.len().max(at + self.each), 0.0);
        &mut self.values[at..at + self.each]
    }

    /// Windows with their values.
    pub(super) fn windows(&self) -> impl Iterator<Item = (i64, &[f32])> {
        (self.first..).zip(self.values.chunks_exact(self.each))
    }

    /// Multiplies all light.
    pub(super) fn scale(&mut self, factor: f32) {
        self.values.iter_mut().for_each(|it| *it *= factor);
    }

    /// Adds other light.
    pub(super) fn add(&mut self, other: &Self) {
        for (number, values) in other.windows() {
            self.window(number).iter_mut().zip(values).for_each(|(sum, it)| *sum += it);
        }
    }

    /// Sum of the products of values.
    pub(super) fn product(&self, other: &Self) -> f64 {
        let [own, other] = [self.values(), other.values()];
        own.places().map(|place| own.at(place) * other.at(place)).sum()
    }
}

/// Values from a place on; others are 0.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Values<'a> {
    /// Place of the first value.
    pub first: i64,
    pub values: &'a [f32],
}

impl Values<'_> {
    /// Value at a place.
    pub(super) fn at(&self, place: i64) -> f64 {
        let at = usize::try_from(place - self.first).ok();
        at.and_then(|at| self.values.get(at)).map_or(0.0, |it| f64::from(*it))
    }

    /// Places of the values.
    pub(super) fn places(&self) -> Range<i64> {
        self.first..self.first + self.values.len() as i64
    }
}

/// Places at which some have values.
pub(super) fn places<'a>(all: impl IntoIterator<Item = Values<'a>>) -> Range<i64> {
    let all = all.into_iter().filter(|it| !it.values.is_empty()).map(|it| it.places());
    all.reduce(|a, b| a.start.min(b.start)..a.end.max(b.end)).unwrap_or(0..0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamlet_core::numbers;

    #[test]
    fn windows_far_from_one_another_have_values_of_their_own() {
        let mut light = WindowLight::new(2);
        for (number, value) in [(3, 1.0), (-2, 2.0), (8, 4.0)] {
            light.window(number)[1] += value;
        }
        let values = light.values();
        assert_eq!(places([values, Values::default()]), -4..18);
        let found = [-3, 7, 17, 16, -5, 19].map(|place| numbers::whole::<u32>(values.at(place)));
        assert_eq!(found, [2, 1, 4, 0, 0, 0]);
        let mut other = WindowLight::new(2);
        other.window(8)[1] = 0.5;
        assert!((light.product(&other) - 2.0).abs() < 1e-12);
        other.add(&light);
        other.scale(2.0);
        assert!((other.values().at(17) - 9.0).abs() < 1e-6);
    }

    #[test]
    fn joined_light_has_the_values_of_each_window_side_by_side() {
        let [mut one, mut two] = [WindowLight::new(1), WindowLight::new(2)];
        one.window(4)[0] = 1.0;
        two.window(2)[1] = 2.0;
        two.window(4)[0] = 3.0;
        let joined = WindowLight::join(&[one, WindowLight::new(1), two]);
        let found: Vec<(i64, Vec<u32>)> = joined
            .windows()
            .map(|(number, values)| {
                (number, values.iter().map(|it| numbers::whole((*it).into())).collect())
            })
            .collect();
        let want = [(2, vec![0, 0, 0, 2]), (3, vec![0; 4]), (4, vec![1, 0, 3, 0])];
        assert_eq!(found, want);
    }
}
