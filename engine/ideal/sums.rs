//! Sums over the rays of a pixel, and the moments of their light.

/// Light of a ray at an energy.
#[derive(Debug, Clone, Copy)]
pub(super) struct RayLight {
    /// Share of the light of the pixel, without the sample.
    pub(super) weight: f64,
    /// Transmission along the ray.
    pub(super) transmission: f64,
    /// Refraction angle, rad.
    pub(super) angle: f64,
    /// Variance of the angle by rough surfaces, rad².
    pub(super) variance: f64,
}

/// Sums over rays.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    weight: f64,
    light: f64,
    /// Light within reach, and its first and second moments by the angle.
    within: [f64; 3],
}

impl Sums {
    fn add(&mut self, ray: &RayLight, reach: f64) {
        let light = ray.weight * ray.transmission;
        self.weight += ray.weight;
        self.light += light;
        if ray.angle.abs() <= reach {
            let moments = [1.0, ray.angle, ray.angle * ray.angle + ray.variance];
            self.within.iter_mut().zip(moments).for_each(|(sum, moment)| *sum += light * moment);
        }
    }

    fn plus(&self, other: &Self) -> Self {
        let within = [0, 1, 2].map(|at| self.within[at] + other.within[at]);
        Self { weight: self.weight + other.weight, light: self.light + other.light, within }
    }

    /// Transmission, mean angle and its variance; NaN where no light is.
    fn contrasts(&self) -> [f64; 3] {
        let [light, first, second] = self.within;
        let mean = first / light;
        [self.light / self.weight, mean, (second / light - mean * mean).max(0.0)]
    }
}

/// Sums over the rays of a pixel, in two halves that cover it alike.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct PixelSums {
    halves: [Sums; 2],
}

impl PixelSums {
    /// Adds the light of the ray of this number.
    pub(super) fn add(&mut self, number: usize, ray: &RayLight, reach: f64) {
        // 0, 1, 1, 0: values linear in the place have the same mean in both halves.
        let half = usize::from(matches!(number % 4, 1 | 2));
        self.halves[half].add(ray, reach);
    }

    /// Transmission, refraction angle (rad) and its variance (rad²).
    pub(super) fn contrasts(&self) -> [f64; 3] {
        self.halves[0].plus(&self.halves[1]).contrasts()
    }

    /// Standard error of each, by the difference of the halves.
    pub(super) fn errors(&self) -> [f64; 3] {
        let [a, b] = self.halves.map(|half| half.contrasts());
        [0, 1, 2].map(|at| 0.5 * (a[at] - b[at]).abs())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ray(transmission: f64, angle: f64) -> RayLight {
        RayLight { weight: 1.0, transmission, angle, variance: 1e-14 }
    }

    #[test]
    fn contrasts_are_moments_of_the_light() {
        let mut sums = PixelSums::default();
        for (number, (transmission, angle)) in
            [(0.5, 1e-6), (1.0, 2e-6), (0.5, 3e-6), (1.0, 1e-3)].into_iter().enumerate()
        {
            sums.add(number, &ray(transmission, angle), 1e-5);
        }
        let [transmission, angle, variance] = sums.contrasts();
        assert!((transmission - 0.75).abs() < 1e-12);
        // 0.25, 0.5 and 0.25 of the light within reach.
        assert!((angle - 2e-6).abs() < 1e-18);
        assert!((variance - 0.51e-12).abs() < 1e-20, "{variance:e}");
    }

    #[test]
    fn halves_see_no_error_in_what_is_linear() {
        let mut sums = PixelSums::default();
        for number in 0..64 {
            sums.add(number, &ray(1.0 - 0.01 * number as f64, 1e-8 * number as f64), 1.0);
        }
        let [transmission, _, _] = sums.errors();
        assert!(transmission < 1e-12, "{transmission:e}");
    }
}
