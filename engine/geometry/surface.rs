//! A triangle surface before it is part of a sample, and what can be wrong with it.

use super::Component;
use beamlet_core::numbers;
use beamlet_core::units::Dimension::Length;
use glam::{DAffine3, DVec3};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Peak bytes per triangle of a mesh while it is read and welded, as measured.
pub const PEAK_PER_TRIANGLE: u64 = 160;
/// Distance from the origin, in sizes of a surface, beyond which its coordinates are rounded about its
/// centre: nearer ones lose at most two bits in f32.
const FAR: f64 = 4.0;
/// Rounding of numbers that were written as f32, share of their last place: nine decimal digits leave
/// at most 0.042.
const AS_SINGLE: f64 = 0.05;
/// Remedy where a mesh does not fit.
pub(super) const SIMPLIFY: &str = "simplify it, or raise the memory limit of this process";

/// A defect of a surface, and its place.
#[derive(Debug)]
pub(super) struct Defect {
    pub(super) problem: String,
    pub(super) place: String,
}

impl Defect {
    pub(super) fn new(problem: impl Into<String>, place: impl Into<String>) -> Self {
        Self { problem: problem.into(), place: place.into() }
    }
}

/// Vertices and the triangles that index them.
#[derive(Debug, Clone, Default)]
pub(super) struct Surface {
    pub(super) vertices: Vec<DVec3>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Number of each triangle in its source, from 1; empty while equal to the numbers of `triangles`.
    numbers: Vec<u32>,
    /// Numbers of triangles that were left out for a coordinate that is not finite.
    pub(super) not_finite: Vec<u32>,
}

/// Result of welding.
#[derive(Debug, Default)]
pub(super) struct Welded {
    /// Triangles left out because two corners became one: number, and a corner.
    pub(super) dropped: Vec<(u32, DVec3)>,
    pub(super) grain: Grain,
}

/// Resolution of the coordinates of a surface, in its unit.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Grain {
    /// Origin of rounding to f32: 0, or along an axis on which the surface is far away its centre.
    about: DVec3,
    /// Largest distance from that origin along an axis.
    pub(super) reach: f64,
    /// One unit of the last place of f32 at the size of the surface; of numbers that were f32, at their
    /// size.
    pub(super) step: f64,
}

/// One unit of the last place of f32 at a number.
pub(super) fn last_place(of: f64) -> f64 {
    let single = numbers::single(of.abs());
    f64::from(single.next_up()) - f64::from(single)
}

impl Surface {
    pub(super) fn new(vertices: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Self {
        Self { vertices, triangles, ..Self::default() }
    }

    /// Adds a triangle with vertices of its own, unless one is not finite; the error names it.
    pub(super) fn push_triangle(&mut self, corners: [DVec3; 3]) -> Result<(), String> {
        let first = u32::try_from(self.vertices.len())
            .ok()
            .filter(|first| *first < u32::MAX - 3)
            .ok_or("more vertices than 32 bits can count")?;
        let pushed = self.triangles.len() + self.not_finite.len();
        let number = u32::try_from(pushed + 1)
            .map_err(|_| "more triangles than 32 bits can count".to_owned())?;
        if !corners.iter().all(|corner| corner.is_finite()) {
            self.not_finite.push(number);
            return Ok(());
        }
        self.vertices.extend(corners);
        self.triangles.push([first, first + 1, first + 2]);
        self.numbers.push(number);
        Ok(())
    }

    /// As [`Self::push_triangle`] for a triangle of another surface, with the number that it has
    /// there.
    pub(super) fn push_numbered(&mut self, corners: [DVec3; 3], number: u32) {
        let first = numbers::count(self.vertices.len());
        self.vertices.extend(corners);
        self.triangles.push([first, first + 1, first + 2]);
        self.numbers.push(number);
    }

    /// Number of a triangle where it came from, counted from 1.
    pub(super) fn number(&self, triangle: u32) -> u32 {
        self.numbers.get(triangle as usize).copied().unwrap_or(triangle + 1)
    }

    /// Number of a corner of a triangle, three for each: the one at a vertex that it has.
    pub(super) fn corner_of(&self, triangle: u32, vertex: u32) -> u32 {
        let [_, b, c] = self.triangles[triangle as usize];
        3 * triangle + u32::from(b == vertex) + 2 * u32::from(c == vertex)
    }

    /// The three corners of a triangle.
    pub(super) fn corners(&self, triangle: usize) -> [DVec3; 3] {
        // Spelled out: the compiler leaves a call of `map` where it is, a tenth of the time.
        let [a, b, c] = self.triangles[triangle];
        [self.vertices[a as usize], self.vertices[b as usize], self.vertices[c as usize]]
    }

    /// The resolution of its coordinates.
    fn grain(&self) -> Grain {
        if self.vertices.is_empty() {
            return Grain::default();
        }
        let [low, high] = self.bounds();
        let size = (high - low).max_element();
        let far = low.abs().max(high.abs());
        let single =
            |it: &f64| (it - f64::from(numbers::single(*it))).abs() <= AS_SINGLE * last_place(*it);
        if self.vertices.par_iter().all(|it| it.to_array().iter().all(single)) {
            let reach = far.max_element();
            return Grain { about: DVec3::ZERO, reach, step: last_place(reach) };
        }
        let about =
            DVec3::select(far.cmpgt(DVec3::splat(FAR * size)), low.midpoint(high), DVec3::ZERO);
        let reach = (low - about).abs().max((high - about).abs()).max_element();
        Grain { about, reach, step: last_place(reach.min(size)) }
    }

    /// Merges vertices that are equal in f32, the precision of STL files and of the device (about the
    /// centre of a surface of finer numbers that is far from the origin); drops the triangles that this
    /// makes degenerate, and unused vertices.
    pub(super) fn weld(&mut self) -> Welded {
        let grain = self.grain();
        // Equal corners are adjacent, the first of each first.
        let mut sorted: Vec<u128> = self
            .triangles
            .as_flattened()
            .par_iter()
            .zip(0..u32::MAX)
            .map(|(vertex, corner)| {
                let vertex = self.vertices[*vertex as usize] - grain.about;
                let [x, y, z] = vertex.as_vec3().to_array().map(bits);
                u128::from(x) << 96 | u128::from(y) << 64 | u128::from(z) << 32 | u128::from(corner)
            })
            .collect();
        sorted.par_sort_unstable();
        // Of each corner the first that is equal, then its vertex.
        let mut vertex_of = vec![0_u32; sorted.len()];
        for equal in sorted.chunk_by(|a, b| a >> 32 == b >> 32) {
            let corner = |it: u128| numbers::low_word(numbers::low_half(it));
            equal.iter().for_each(|it| vertex_of[corner(*it) as usize] = corner(equal[0]));
        }
        drop(sorted);
        let mut vertices = Vec::with_capacity(self.triangles.len() / 2 + 2);
        for (corner, vertex) in self.triangles.as_flattened().iter().enumerate() {
            let first = vertex_of[corner] as usize;
            vertex_of[corner] = if first == corner {
                vertices.push(self.vertices[*vertex as usize]);
                numbers::count(vertices.len() - 1)
            } else {
                vertex_of[first]
            };
        }
        let mut triangles = Vec::with_capacity(self.triangles.len());
        let mut numbers = Vec::with_capacity(self.triangles.len());
        let mut dropped = Vec::new();
        for (corners, index) in vertex_of.as_chunks::<3>().0.iter().zip(0..) {
            let corners = *corners;
            let [a, b, c] = corners;
            if a != b && b != c && c != a {
                triangles.push(corners);
                numbers.push(self.number(index));
            } else {
                dropped.push((self.number(index), vertices[a as usize]));
            }
        }
        self.vertices = vertices;
        self.triangles = triangles;
        self.numbers = numbers;
        if !dropped.is_empty() {
            self.forget_unused();
        }
        Welded { dropped, grain }
    }

    /// Puts the vertices `to` gives in the place of others; returns the triangles that are left out
    /// because two corners became one: number, and a corner.
    pub(super) fn replace_vertices(&mut self, to: &[u32]) -> Vec<(u32, DVec3)> {
        self.triangles.as_flattened_mut().iter_mut().for_each(|it| *it = to[*it as usize]);
        let is_line = |[a, b, c]: [u32; 3]| a == b || b == c || c == a;
        let lines: Vec<bool> = self.triangles.iter().map(|it| is_line(*it)).collect();
        let dropped = (0_u32..)
            .zip(&lines)
            .filter(|it| *it.1)
            .map(|(at, _)| (self.number(at), self.corners(at as usize)[0]))
            .collect();
        self.keep(|triangle| !lines[triangle]);
        dropped
    }

    /// Puts parts in the place of triangles; they keep the number of their triangle.
    pub(super) fn replace_triangles(&mut self, parts: &BTreeMap<u32, Vec<[u32; 3]>>) {
        let (mut triangles, mut numbers) = (Vec::new(), Vec::new());
        for (triangle, at) in self.triangles.iter().zip(0..) {
            let own = parts.get(&at).map_or(std::slice::from_ref(triangle), Vec::as_slice);
            triangles.extend(own);
            numbers.extend(own.iter().map(|_| self.number(at)));
        }
        self.triangles = triangles;
        self.numbers = numbers;
    }

    /// Keeps the triangles that are wanted, and their vertices.
    pub(super) fn keep(&mut self, wanted: impl Fn(usize) -> bool) {
        self.numbers = (0..)
            .take(self.triangles.len())
            .filter(|triangle| wanted(*triangle as usize))
            .map(|triangle| self.number(triangle))
            .collect();
        let mut triangle = 0;
        self.triangles.retain(|_| {
            triangle += 1;
            wanted(triangle - 1)
        });
        self.forget_unused();
    }

    /// The surface of some of its triangles, by their numbers, with the vertices that they use.
    pub(super) fn part(&self, triangles: &[u32]) -> Self {
        let corners = triangles.iter().map(|it| self.triangles[*it as usize]);
        let mut used: Vec<u32> = corners.clone().flatten().collect();
        used.sort_unstable();
        used.dedup();
        let place = |corner: u32| numbers::count(used.binary_search(&corner).unwrap_or_default());
        let triangles = corners.map(|it| it.map(place)).collect();
        let vertices = used.iter().map(|corner| self.vertices[*corner as usize]).collect();
        Self::new(vertices, triangles)
    }

    /// The surface elsewhere.
    pub(super) fn mapped(&self, by: DAffine3) -> Self {
        let vertices = self.vertices.par_iter().map(|it| by.transform_point3(*it)).collect();
        Self::new(vertices, self.triangles.clone())
    }

    /// Adds another surface, with its vertices behind those that are there.
    pub(super) fn append(&mut self, other: Self) {
        let first = numbers::count(self.vertices.len());
        self.numbers.clear();
        self.vertices.extend(other.vertices);
        self.triangles.extend(other.triangles.iter().map(|it| it.map(|corner| corner + first)));
    }

    /// Removes vertices that no triangle uses: they would count in the bounding box.
    fn forget_unused(&mut self) {
        let mut moved = vec![None; self.vertices.len()];
        let mut vertices = Vec::with_capacity(self.vertices.len());
        for corner in self.triangles.as_flattened_mut() {
            *corner = *moved[*corner as usize].get_or_insert_with(|| {
                vertices.push(self.vertices[*corner as usize]);
                numbers::count(vertices.len() - 1)
            });
        }
        self.vertices = vertices;
    }

    /// Bounding box of the vertices.
    pub(super) fn bounds(&self) -> [DVec3; 2] {
        bounds_of(self.vertices.iter().copied())
    }
}

/// Equal for equal numbers: -0 is 0.
fn bits(x: f32) -> u32 {
    (x + 0.0).to_bits()
}

/// The bounding box of a component as vectors.
pub(super) fn corners_of(component: &Component) -> [DVec3; 2] {
    component.bounds.map(DVec3::from_array)
}

/// Bounding box of points; empty (min above max) for none.
pub(super) fn bounds_of(points: impl Iterator<Item = DVec3>) -> [DVec3; 2] {
    points.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], point| {
        [low.min(point), high.max(point)]
    })
}

/// True if two boxes come within `margin` of each other, axis by axis.
pub(super) fn near(a: [DVec3; 2], b: [DVec3; 2], margin: f64) -> bool {
    (a[0] - margin).cmple(b[1]).all() && (b[0] - margin).cmple(a[1]).all()
}

/// True if the box `inner` lies in the box `outer`.
pub(super) fn encloses(outer: [DVec3; 2], inner: [DVec3; 2]) -> bool {
    outer[0].cmple(inner[0]).all() && inner[1].cmple(outer[1]).all()
}

/// A length to two digits, for messages.
pub(super) fn rounded(length: f64) -> String {
    Length.format(format!("{length:.1e}").parse().unwrap_or(length))
}

/// A position in mm, for messages.
pub(super) fn in_mm(point: DVec3) -> String {
    let mm = point * 1e3;
    format!("({:.6}, {:.6}, {:.6}) mm", mm.x, mm.y, mm.z)
}
