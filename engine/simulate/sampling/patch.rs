//! A patch: one beamlet and detector row, cut into rectangles. A rectangle is represented by the ray
//! through its centre. Rectangles are split in three, so that the middle one keeps the
//! ray. Their coordinates are (x - shear (z - 1/2), z): a silhouette that slants by `shear` is upright in
//! them.

mod beside;
mod node;

pub(super) use beside::Witness;
pub(super) use node::{Axis, Node, Slopes, alike, is_drawn, no_silhouette_between};

use beamlet_core::numbers::{self, single};
use beamlet_interface::RayResult;
use std::ops::Range;

/// Golden section, the number that fractions approach worst.
const GOLDEN: f64 = 0.618_033_988_749_894_9;
/// Parts of a rectangle that is split.
pub(super) const PARTS: u32 = 3;

/// A split: its axis, the first of its parts, and the upper borders of all parts but the last.
#[derive(Debug, Clone, Copy)]
struct Branch {
    axis: Axis,
    first: u32,
    borders: [f32; PARTS as usize - 1],
}

/// Bytes of a rectangle of a patch.
pub(super) const RECTANGLE: usize = size_of::<Node>() + size_of::<Option<Branch>>();

/// Lines of a patch whose rays are spread evenly, powers of two: fewest and most. On four lines light of a foam
/// over borders of rows errs by 3.8e-3 (`light_of_foams_is_that_of_random_rays`).
const EVEN_LINES: [u32; 2] = [4, 64];

/// Phase of a patch whose rays are spread evenly, for structure that they do not resolve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Even {
    /// Trial rays, which determine the number.
    Trial,
    /// The final number of rays.
    Settled,
}

/// One beamlet and detector row.
#[derive(Debug, Clone)]
pub(super) struct Patch {
    pub(crate) beamlet: i64,
    pub(crate) row: i64,
    /// Rectangles before refinement in x and z.
    base: [u32; 2],
    /// Their borders along x, m: beyond half a period where they slant.
    borders: Vec<f32>,
    /// How far x moves over the row, m.
    pub(super) shear: f32,
    /// Change of x by the curvature of its silhouettes, m per row squared, where they are not.
    pub(crate) bow: f32,
    /// Phase of its evenly spread rays; `None` where rectangles are refined.
    pub(crate) even: Option<Even>,
    /// The base rectangles, by z, then x; then the parts of those that were split.
    pub(super) nodes: Vec<Node>,
    /// How each of them was split: apart from them, since whoever looks for a leaf passes many.
    branches: Vec<Option<Branch>>,
    pub(crate) splits: u32,
    /// Rays that crossed other surfaces than the rectangle that contains them.
    pub(super) witnesses: Vec<Witness>,
}

/// Where a patch lies: its beamlet and detector row, and how far x moves over the row, m.
#[derive(Debug, Clone, Copy)]
pub(super) struct PatchPlace {
    pub(super) beamlet: i64,
    pub(super) row: i64,
    pub(super) shear: f32,
}

impl PatchPlace {
    /// Place (m from the beamlet's centre, share of the row) of coordinates of rectangles.
    pub(super) fn place(&self, [x, z]: [f32; 2]) -> [f32; 2] {
        [x + self.shear * (z - 0.5), z]
    }
}

/// Borders of `count` equal parts of an interval.
pub(super) fn part(range: [f32; 2], index: u32, count: u32) -> [f32; 2] {
    let at = |i: u32| {
        if i == count {
            range[1]
        } else {
            range[0] + (range[1] - range[0]) * (i as f32 / count as f32)
        }
    };
    [at(index), at(index + 1)]
}

impl Patch {
    /// A patch of base rectangles that cover the period, with these results, by z, then x.
    pub(super) fn new(
        beamlet: i64,
        row: i64,
        period: f32,
        base: [u32; 2],
        results: &[RayResult],
    ) -> Self {
        let mut patch = Self::sheared(beamlet, row, 0.5 * period, 0.0, base);
        for (node, result) in patch.nodes.iter_mut().zip(results) {
            node.result = *result;
        }
        patch
    }

    /// A patch of base rectangles whose results are to be set.
    pub(super) fn sheared(
        beamlet: i64,
        row: i64,
        half_width: f32,
        shear: f32,
        base: [u32; 2],
    ) -> Self {
        let border = |index: u32| part([-half_width, half_width], index, base[0])[0];
        let borders = (0..base[0]).map(border).chain([half_width]).collect();
        Self { shear, ..Self::slabs(beamlet, row, borders, base[1]) }
    }

    /// A patch of upright rectangles with these borders on this number of lines, whose results are to
    /// be set.
    pub(super) fn slabs(beamlet: i64, row: i64, borders: Vec<f32>, lines: u32) -> Self {
        let columns = borders.len().saturating_sub(1);
        let node = |index: usize| {
            let column = index % columns;
            let z = part([0.0, 1.0], numbers::count(index / columns), lines);
            let x = [borders[column], borders[column + 1]];
            Node::new(x, z, bytemuck::Zeroable::zeroed())
        };
        let nodes: Vec<Node> = (0..columns * lines as usize).map(node).collect();
        Self {
            beamlet,
            row,
            base: [numbers::count(columns), lines],
            borders,
            shear: 0.0,
            bow: 0.0,
            even: None,
            branches: vec![None; nodes.len()],
            nodes,
            splits: 0,
            witnesses: Vec::new(),
        }
    }

    /// A patch of rectangles with these borders whose rays are spread evenly on some lines; results are to be set.
    pub(super) fn even(
        [beamlet, row]: [i64; 2],
        borders: Vec<f32>,
        (lines, even): (u32, Even),
    ) -> Self {
        Self { even: Some(even), ..Self::slabs(beamlet, row, borders, lines) }
    }

    /// Lines of a patch of `count` rays that are spread evenly. What refraction throws over a border of the row is
    /// taken from the rays of the first or last line, which are to lie near it.
    pub(super) fn even_lines(count: u32) -> u32 {
        let [fewest, most] = EVEN_LINES;
        let wanted = numbers::whole::<u32>(f64::from(count).sqrt() / 2.0).clamp(fewest, most);
        1 << wanted.ilog2()
    }

    /// Number of the lines that it began with.
    pub(super) const fn lines(&self) -> u32 {
        self.base[1]
    }

    /// Place of the rays of a line in their rectangles, fraction of the width: no two lines have rays above one
    /// another.
    fn place_of_line(&self, line: u32) -> f32 {
        let lines = self.lines();
        let reversed = line.reverse_bits() >> (32 - lines.ilog2());
        (reversed as f32 + 0.5) / lines as f32
    }

    /// Its place.
    pub(super) const fn at(&self) -> PatchPlace {
        PatchPlace { beamlet: self.beamlet, row: self.row, shear: self.shear }
    }

    /// The same of coordinates of rectangles.
    pub(super) fn place(&self, coordinates: [f32; 2]) -> [f32; 2] {
        self.at().place(coordinates)
    }

    /// Coordinates of a place.
    pub(super) fn coordinates(&self, [x, z]: [f32; 2]) -> [f32; 2] {
        [x - self.shear * (z - 0.5), z]
    }

    /// True if coordinates lie in a rectangle.
    pub(super) fn holds(&self, [x, z]: [f32; 2]) -> bool {
        x >= self.borders[0] && x < self.borders[self.base[0] as usize] && (0.0..1.0).contains(&z)
    }

    /// The leaf that holds these coordinates.
    pub(super) fn leaf_at(&self, x: f32, z: f32) -> u32 {
        let column = self.borders.partition_point(|border| *border <= x).saturating_sub(1);
        let column = numbers::count(column).min(self.base[0] - 1);
        let line = numbers::whole::<u32>(f64::from(z * self.base[1] as f32)).min(self.base[1] - 1);
        let mut leaf = line * self.base[0] + column;
        while let Some(Branch { axis, first, borders: [lower, upper] }) =
            self.branches[leaf as usize]
        {
            let at = if axis == Axis::X { x } else { z };
            leaf = first + u32::from(at >= lower) + u32::from(at >= lower && at >= upper);
        }
        leaf
    }

    /// True if a rectangle can be split along an axis in f32.
    pub(super) fn can_split(&self, node: u32, axis: Axis, least: [f32; 2]) -> bool {
        let node = &self.nodes[node as usize];
        match axis {
            Axis::X => node.width() > PARTS as f32 * least[0],
            Axis::Z => node.height() > PARTS as f32 * least[1],
        }
    }

    /// Splits a leaf; its parts begin with its result.
    pub(super) fn split(&mut self, index: u32, axis: Axis) -> Range<u32> {
        let parent = self.nodes[index as usize];
        let first = numbers::count(self.nodes.len());
        let sides = if axis == Axis::X { parent.x } else { parent.z };
        let borders = [0, 1].map(|i| part(sides, i, PARTS)[1]);
        self.branches[index as usize] = Some(Branch { axis, first, borders });
        for i in 0..PARTS {
            let side = part(sides, i, PARTS);
            let (x, z) = if axis == Axis::X { (side, parent.z) } else { (parent.x, side) };
            self.nodes.push(Node::new(x, z, parent.result));
            self.branches.push(None);
        }
        self.splits += 1;
        first..first + PARTS
    }

    /// Coordinates of the ray of a rectangle: its centre, but where rays are spread evenly.
    pub(super) fn ray_coordinates(&self, index: u32) -> [f32; 2] {
        let node = &self.nodes[index as usize];
        if self.even.is_none() {
            return node.centre();
        }
        // Heights are a Kronecker sequence: any rectangles that follow one another cover the line.
        let height = single((0.5 + f64::from(index) * GOLDEN).fract());
        let place = self.place_of_line(index / self.base[0]);
        [node.x[0] + place * node.width(), node.z[0] + height * node.height()]
    }

    /// The place of the ray of a rectangle.
    pub(super) fn ray(&self, node: u32) -> [f32; 2] {
        self.place(self.ray_coordinates(node))
    }

    /// Sets the result of a rectangle to the result of its ray.
    pub(super) fn set_result(&mut self, node: u32, result: &RayResult) {
        self.nodes[node as usize].result = *result;
    }

    /// Its size in memory, in rectangles.
    pub(super) fn size(&self) -> usize {
        self.nodes.len()
    }

    /// Bytes that it holds.
    pub(super) fn bytes(&self) -> usize {
        self.nodes.capacity() * size_of::<Node>()
            + self.branches.capacity() * size_of::<Option<Branch>>()
            + self.witnesses.capacity() * size_of::<Witness>()
    }

    /// Indices of the leaves.
    pub(super) fn leaves(&self) -> impl Iterator<Item = u32> {
        (0..numbers::count(self.nodes.len())).filter(|node| self.branches[*node as usize].is_none())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_lies_in_the_leaf_that_is_found_for_it() {
        let results = vec![<RayResult as bytemuck::Zeroable>::zeroed(); 6];
        let mut patch = Patch::new(0, 0, 100e-6, [3, 2], &results);
        let mut next = 7_u32;
        for _ in 0..200 {
            next = next.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let leaves: Vec<u32> = patch.leaves().collect();
            let leaf = leaves[(next >> 8) as usize % leaves.len()];
            patch.split(leaf, if next & 64 == 0 { Axis::X } else { Axis::Z });
        }
        let mut area = 0.0;
        for leaf in patch.leaves() {
            let node = patch.nodes[leaf as usize];
            let [x, z] = node.centre();
            assert_eq!(patch.leaf_at(x, z), leaf);
            area += f64::from(node.width()) * f64::from(node.height());
        }
        assert!((area - 100e-6).abs() < 1e-11, "{area}");
    }
}
