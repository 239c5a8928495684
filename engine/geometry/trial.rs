//! Trial rays through a mesh with defects: do they leave it as often as they enter it?

use std::f64::consts::TAU;
use std::fmt::{self, Display, Formatter};

use glam::DVec3;
use rayon::prelude::*;

use super::search::Search;
use super::surface::{Surface, rounded};

/// Number of rays.
const RAYS: u32 = 4096;
/// Root of x^6 = x + 1: its powers place points evenly in five dimensions (Roberts' R sequence).
const EVEN: f64 = 1.134_724_138_401_519;
/// Length of a negative path that counts, share of the size: far above rounding.
const NEGATIVE: f64 = 1e-6;

/// Wrong rays of a trial, in all directions and evenly over the bounding box.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Trial {
    /// Rays with unequal numbers of entries and exits.
    unbalanced: usize,
    /// Other rays that leave the surface before they enter it.
    negative: usize,
    /// Longest such part of a ray, m.
    longest: f64,
}

impl Trial {
    /// The trial of an oriented surface.
    pub(super) fn of(surface: &Surface) -> Self {
        let search = Search::new(surface);
        let [low, high] = surface.bounds();
        let size = low.distance(high);
        let ray = |number: u32| {
            let share = |k: i32| (f64::from(number) * EVEN.powi(-k)).fract();
            let inside = low + (high - low) * DVec3::new(share(1), share(2), share(3));
            let (z, turn) = (2.0 * share(4) - 1.0, TAU * share(5));
            let flat = (1.0 - z * z).sqrt();
            let direction = DVec3::new(flat * libm::cos(turn), flat * libm::sin(turn), z);
            let hits = search.windings(surface, inside - size * direction, direction);
            // A ray through an edge says nothing.
            let hits = hits.unwrap_or_default();
            if hits.last().is_some_and(|hit| hit.1 != 0) {
                return Self { unbalanced: 1, ..Self::default() };
            }
            let below = hits.windows(2).filter(|pair| pair[0].1 < 0);
            let longest = below.map(|pair| pair[1].0 - pair[0].0).sum();
            match longest > NEGATIVE * size {
                true => Self { negative: 1, longest, unbalanced: 0 },
                false => Self::default(),
            }
        };
        (1..=RAYS).into_par_iter().map(ray).reduce(Self::default, |a, b| Self {
            unbalanced: a.unbalanced + b.unbalanced,
            negative: a.negative + b.negative,
            longest: a.longest.max(b.longest),
        })
    }

    /// True if no ray is wrong.
    pub(super) fn is_sound(&self) -> bool {
        self.unbalanced + self.negative == 0
    }
}

/// The wrong rays in words.
impl Display for Trial {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { unbalanced, negative, longest } = self;
        match (unbalanced, negative) {
            (0, 0) => write!(f, "{RAYS} trial rays found no wrong path"),
            (_, 0) => {
                write!(f, "{unbalanced} of {RAYS} trial rays enter and leave it unequally often")
            }
            (0, _) => write!(
                f,
                "{negative} of {RAYS} trial rays have negative paths, to -{}",
                rounded(*longest)
            ),
            _ => write!(
                f,
                "{unbalanced} of {RAYS} trial rays enter and leave it unequally often, and \
                 {negative} have negative paths, to -{}",
                rounded(*longest)
            ),
        }
    }
}
