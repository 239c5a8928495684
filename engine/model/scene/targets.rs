//! Targets of the random rays of a pixel.

use super::{Scene, Scheme};

/// Targets of the random rays of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RandomRays {
    /// A number of targets, evenly spaced along x and spread over the height of the pixel. >= 1.
    Count(u32),
    /// The paper's grid: targets evenly spaced in x and z, by their numbers. >= 1 each.
    Grid([u32; 2]),
}

impl RandomRays {
    /// Rays of a pixel.
    #[must_use]
    pub const fn count(self) -> u32 {
        match self {
            Self::Count(count) => count,
            Self::Grid([x, z]) => x.saturating_mul(z),
        }
    }

    /// Rays of each of the parts of a pixel, by the number of parts along x and z.
    pub(crate) fn of_part(self, parts: [u32; 2]) -> Self {
        match self {
            Self::Count(count) => Self::Count(count.div_ceil(parts[0] * parts[1])),
            Self::Grid(grid) => Self::Grid([0, 1].map(|axis| grid[axis].div_ceil(parts[axis]))),
        }
    }

    /// About half of the rays.
    #[doc(hidden)]
    pub fn halved(self) -> Self {
        let [x, z] = match self {
            Self::Count(count) => [count, 1],
            Self::Grid(grid) => grid,
        };
        self.of_part(if x >= z { [2, 1] } else { [1, 2] })
    }
}

impl Scene {
    /// Warning where all random rays of a pixel pass the sample on one line.
    #[doc(hidden)]
    pub fn middle_line_warning(&self) -> Option<String> {
        let RandomRays::Grid([x, z @ 1]) = self.sampling.rays else { return None };
        let random = self.sampling.scheme == Scheme::Random;
        (random && !self.listed_objects().is_empty()).then(|| {
            format!(
                "sampling.rays = [{x}, {z}]: all targets of a pixel lie on its middle line, and edges \
                 across it are wrong; rays = {x} spreads them over its height"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::RandomRays::{Count, Grid};

    #[test]
    fn parts_of_a_pixel_have_its_rays_together() {
        assert_eq!(Count(5000).of_part([3, 2]), Count(834));
        assert_eq!(Count(5).of_part([64, 16]), Count(1));
        assert_eq!(Grid([100, 3]).of_part([3, 2]), Grid([34, 2]));
        assert_eq!([Count(7).halved(), Grid([2, 9]).halved()], [Count(4), Grid([2, 5])]);
    }
}
