//! Scanlines of a patch, traced to find how its silhouettes slant.

use super::patch::no_silhouette_between;
use crate::interface::RayResult;

/// Heights of the scanlines, share of the row.
const HEIGHTS: [f32; 3] = [1.0 / 6.0, 0.5, 5.0 / 6.0];
/// Times that an interval with a silhouette is halved.
const HALVINGS: u32 = 12;

/// Silhouettes that slant by the same over a row to this, m, are straight.
const STRAIGHT: f32 = 0.1e-6;

/// How silhouettes slant.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slant {
    /// Change of x over the row, m.
    pub(super) shear: f32,
    /// All slant alike, at all heights.
    pub(super) straight: bool,
    /// Largest change of x by curvature, m per row squared, of those that stand on all scanlines.
    pub(super) bow: f32,
}

/// Scanlines at three heights, with the rays that bracket silhouettes.
#[derive(Debug)]
pub(super) struct Scanlines {
    lines: [Vec<(f32, RayResult)>; 3],
    pending: Vec<(usize, f32)>,
    halvings: u32,
}

impl Scanlines {
    /// Scanlines of `cells` intervals of a period, m.
    pub(super) fn new(period: f32, cells: u32) -> Self {
        let place = |i: u32| period * (i as f32 / cells as f32 - 0.5);
        let pending = (0..HEIGHTS.len())
            .flat_map(|line| (0..=cells).map(move |i| (line, place(i))))
            .collect();
        Self { lines: Default::default(), pending, halvings: 0 }
    }

    /// Places of the rays wanted next.
    pub(super) fn pending(&self) -> Vec<[f32; 2]> {
        self.pending.iter().map(|(line, x)| [*x, HEIGHTS[*line]]).collect()
    }

    /// Takes the results of the rays wanted.
    pub(super) fn accept(&mut self, results: &[RayResult]) {
        for ((line, x), result) in std::mem::take(&mut self.pending).into_iter().zip(results) {
            self.lines[line].push((x, *result));
        }
        self.lines.iter_mut().for_each(|line| line.sort_unstable_by(|a, b| a.0.total_cmp(&b.0)));
        if self.halvings == HALVINGS {
            return;
        }
        self.halvings += 1;
        for (number, line) in self.lines.iter().enumerate() {
            for (low, high) in brackets(line) {
                self.pending.push((number, 0.5 * (low.0 + high.0)));
            }
        }
    }

    /// How the silhouettes slant that stand on two scanlines or more: by the median.
    pub(super) fn slant(&self) -> Option<Slant> {
        let mut slants = Vec::new();
        let mut unmatched = 0;
        // By silhouette of the middle scanline.
        let mut above: Vec<Option<f32>> = vec![None; self.lines[1].len()];
        let mut bow = 0.0_f32;
        for (a, b) in [(0, 1), (1, 2)] {
            let rise = HEIGHTS[b] - HEIGHTS[a];
            let mut taken = vec![false; self.lines[b].len()];
            for (number, (low, high)) in brackets(&self.lines[a]).enumerate() {
                let same = brackets(&self.lines[b]).enumerate().find(|(index, other)| {
                    !taken[*index]
                        && no_silhouette_between(&other.0.1, &low.1)
                        && no_silhouette_between(&other.1.1, &high.1)
                });
                if let Some((index, other)) = same {
                    taken[index] = true;
                    let middle = |(low, high): (&(f32, RayResult), &(f32, RayResult))| {
                        0.5 * (low.0 + high.0)
                    };
                    let slant = (middle(other) - middle((low, high))) / rise;
                    if a == 0 {
                        above[index] = Some(slant);
                    } else if let Some(above) = above[number] {
                        bow = bow.max((slant - above).abs() / rise);
                    }
                    slants.push(slant);
                } else {
                    unmatched += 1;
                }
            }
        }
        slants.sort_unstable_by(f32::total_cmp);
        let shear = *slants.get(slants.len() / 2)?;
        let straight = slants.iter().all(|slant| (slant - shear).abs() <= STRAIGHT);
        Some(Slant { shear, straight: straight && unmatched <= 1, bow })
    }
}

/// Neighbouring rays of a line that crossed different objects.
fn brackets(
    line: &[(f32, RayResult)],
) -> impl Iterator<Item = (&(f32, RayResult), &(f32, RayResult))> {
    line.windows(2)
        .filter(|pair| !no_silhouette_between(&pair[0].1, &pair[1].1))
        .map(|pair| (&pair[0], &pair[1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slanting_edge_is_found_to_a_share_of_a_cell() {
        let edge = |z: f32| 7e-6 + 17e-6 * (z - 0.5);
        let mut lines = Scanlines::new(100e-6, 5);
        loop {
            let places = lines.pending();
            if places.is_empty() {
                break;
            }
            let result = |[x, z]: &[f32; 2]| RayResult {
                signature: u32::from(*x > edge(*z)),
                ..bytemuck::Zeroable::zeroed()
            };
            let results: Vec<RayResult> = places.iter().map(result).collect();
            lines.accept(&results);
        }
        let slant = lines.slant().unwrap();
        assert!((slant.shear - 17e-6).abs() < 0.05e-6 && slant.straight, "{slant:?}");
        assert!(slant.bow < 0.2e-6, "{slant:?}");
    }

    #[test]
    fn the_bow_of_an_edge_is_its_curvature() {
        let edge = |z: f32| 7e-6 + 17e-6 * z + 0.5 * 28e-6 * (z - 0.5).powi(2);
        let mut lines = Scanlines::new(100e-6, 5);
        while !lines.pending().is_empty() {
            let result = |[x, z]: &[f32; 2]| RayResult {
                signature: u32::from(*x > edge(*z)),
                ..bytemuck::Zeroable::zeroed()
            };
            let results: Vec<RayResult> = lines.pending().iter().map(result).collect();
            lines.accept(&results);
        }
        let slant = lines.slant().unwrap();
        assert!((slant.bow - 28e-6).abs() < 0.2e-6 && !slant.straight, "{slant:?}");
    }
}
