//! Scanlines of a patch, traced to find how its silhouettes slant.

use super::patch::no_silhouette_between;
use super::refinement::Rounds;
use beamlet_interface::RayResult;

/// Heights of the first scanlines, fraction of the row. On fewer lines a rim that leaves the row by a side does
/// not show how it bows (`a_rim_that_leaves_by_a_side`).
const HEIGHTS: [f32; 5] = [0.1, 0.3, 0.5, 0.7, 0.9];
/// Times that an interval with a silhouette is halved.
const HALVINGS: u32 = 12;

/// How silhouettes slant.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slant {
    /// Change of x over the row, m.
    pub(super) shear: f32,
    /// Largest curvature of silhouettes seen on three scanlines: change of x, m per row squared.
    pub(super) bow: f32,
}

/// A scanline: its height, and its rays in the order of x.
#[derive(Debug)]
struct Scanline {
    height: f32,
    rays: Vec<(f32, RayResult)>,
    halvings: u32,
}

/// A silhouette from one scanline to the next.
struct Section {
    /// Its numbers among the silhouettes of both.
    numbers: [usize; 2],
    /// Heights of both.
    heights: [f32; 2],
    /// Change of x over the row that this makes, m.
    slant: f32,
}

/// Scanlines with the rays that bracket silhouettes, from above.
#[derive(Debug)]
pub(super) struct Scanlines {
    period: f32,
    /// Intervals of each to begin with.
    cells: u32,
    lines: Vec<Scanline>,
    /// Number of the line, and x.
    pending: Vec<(usize, f32)>,
    /// Lines were added between the two that a silhouette crosses alone.
    doubled: bool,
}

impl Scanlines {
    /// Scanlines of `cells` intervals of a period, m.
    pub(super) fn new(period: f32, cells: u32) -> Self {
        let (lines, pending) = (Vec::new(), Vec::new());
        let mut scanlines = Self { period, cells, lines, pending, doubled: false };
        scanlines.add(&HEIGHTS);
        scanlines
    }

    /// Adds lines at these heights and requests their rays.
    fn add(&mut self, heights: &[f32]) {
        let line = |height: &f32| Scanline { height: *height, rays: Vec::new(), halvings: 0 };
        self.lines.extend(heights.iter().map(line));
        self.lines.sort_by(|a, b| a.height.total_cmp(&b.height));
        let new = self.lines.iter().enumerate().filter(|(_, line)| line.rays.is_empty());
        let place = |i: u32| self.period * (i as f32 / self.cells as f32 - 0.5);
        let places = new.flat_map(|(line, _)| (0..=self.cells).map(move |i| (line, place(i))));
        self.pending.extend(places);
    }

    /// Silhouettes between scanlines that follow one another.
    fn sections(&self) -> Vec<Vec<Section>> {
        let between = |pair: &[Scanline]| {
            let [a, b] = pair else { return Vec::new() };
            let mut taken = vec![false; b.rays.len()];
            let mut sections = Vec::new();
            for (number, (low, high)) in brackets(&a.rays).enumerate() {
                let same = brackets(&b.rays).enumerate().find(|(index, other)| {
                    !taken[*index]
                        && no_silhouette_between(&other.0.1, &low.1)
                        && no_silhouette_between(&other.1.1, &high.1)
                });
                let Some((index, other)) = same else { continue };
                taken[index] = true;
                let step = 0.5 * (other.0.0 + other.1.0) - 0.5 * (low.0 + high.0);
                sections.push(Section {
                    numbers: [number, index],
                    heights: [a.height, b.height],
                    slant: step / (b.height - a.height),
                });
            }
            sections
        };
        self.lines.windows(2).map(between).collect()
    }

    /// Heights between the two scanlines of a silhouette that has only two: they do not show its
    /// curvature.
    fn between(&self) -> Vec<f32> {
        let sections = self.sections();
        let continued = |gap: usize, section: &Section| {
            let above = gap.checked_sub(1).and_then(|gap| sections.get(gap));
            let above = above.into_iter().flatten().any(|it| it.numbers[1] == section.numbers[0]);
            let below = sections.get(gap + 1).into_iter().flatten();
            above || below.into_iter().any(|it| it.numbers[0] == section.numbers[1])
        };
        let alone = |(gap, all): (usize, &Vec<Section>)| {
            let found = all.iter().find(|section| !continued(gap, section))?;
            Some(0.5 * (found.heights[0] + found.heights[1]))
        };
        sections.iter().enumerate().filter_map(alone).collect()
    }

    /// Median slant of the silhouettes found on two scanlines or more.
    pub(super) fn slant(&self) -> Option<Slant> {
        let sections = self.sections();
        let mut bow = 0.0_f32;
        for (above, below) in sections.iter().zip(sections.iter().skip(1)) {
            for section in below {
                let same = above.iter().find(|it| it.numbers[1] == section.numbers[0]);
                if let Some(same) = same {
                    let apart = 0.5 * (section.heights[1] - same.heights[0]);
                    bow = bow.max((section.slant - same.slant).abs() / apart);
                }
            }
        }
        let mut slants: Vec<f32> = sections.iter().flatten().map(|it| it.slant).collect();
        slants.sort_unstable_by(f32::total_cmp);
        let shear = *slants.get(slants.len() / 2)?;
        Some(Slant { shear, bow })
    }
}

impl Rounds for Scanlines {
    fn pending(&self) -> Vec<[f32; 2]> {
        self.pending.iter().map(|(line, x)| [*x, self.lines[*line].height]).collect()
    }

    fn accept(&mut self, results: &[RayResult]) {
        for ((line, x), result) in std::mem::take(&mut self.pending).into_iter().zip(results) {
            self.lines[line].rays.push((x, *result));
        }
        for (number, line) in self.lines.iter_mut().enumerate() {
            line.rays.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
            if line.halvings < HALVINGS {
                line.halvings += 1;
                let middle = |(low, high): Bracket<'_>| (number, 0.5 * (low.0 + high.0));
                self.pending.extend(brackets(&line.rays).map(middle));
            }
        }
        if self.pending.is_empty() && !self.doubled {
            self.doubled = true;
            self.add(&self.between());
        }
    }
}

/// The rays on both sides of a silhouette.
type Bracket<'a> = (&'a (f32, RayResult), &'a (f32, RayResult));

/// Neighbouring rays of a line that crossed different objects.
fn brackets(line: &[(f32, RayResult)]) -> impl Iterator<Item = Bracket<'_>> {
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
        assert!((slant.shear - 17e-6).abs() < 0.05e-6, "{slant:?}");
        assert!(slant.bow < 0.2e-6, "{slant:?}");
    }

    #[test]
    fn an_edge_on_two_lines_alone_gets_a_third() {
        let edge = |z: f32| 7e-6 + 17e-6 * z + 0.5 * 28e-6 * (z - 0.5).powi(2);
        let mut lines = Scanlines::new(100e-6, 5);
        while !lines.pending().is_empty() {
            let result = |[x, z]: &[f32; 2]| RayResult {
                signature: u32::from(*z < 0.65 || *x > edge(*z)),
                ..bytemuck::Zeroable::zeroed()
            };
            let results: Vec<RayResult> = lines.pending().iter().map(result).collect();
            lines.accept(&results);
        }
        let slant = lines.slant().unwrap();
        assert!((slant.bow - 28e-6).abs() < 1e-6, "{slant:?}");
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
        assert!((slant.bow - 28e-6).abs() < 0.2e-6, "{slant:?}");
    }
}
