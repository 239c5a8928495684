//! Exact shapes of opaque objects in a parallel view, without rays on a device: only the surface in front shows, so
//! that bodies take the time of the pixels in which they are seen.

use crate::numbers::{self, single};
use beamlet::cli_support::Placed;
use beamlet::geometry::Sample;
use glam::DVec3;
use rayon::prelude::*;
use std::ops::Range;

/// Rows of a part, which one thread draws.
const ROWS: usize = 64;
/// Least slope of a body, columns per row or rows per column, whose strip is looked for.
const SLANTED: f64 = 0.05;
/// No body.
const NONE: u32 = u32::MAX;

/// A square picture of a sample along an axis, with its points as numbers of half its width.
#[derive(Debug)]
pub(super) struct View {
    /// To the right, into the picture and upwards, in the world.
    pub(super) axes: [DVec3; 3],
    /// Middle of the picture: across, into it and up, m.
    pub(super) centre: [f64; 3],
    /// Half the width, m.
    pub(super) half: f64,
}

impl View {
    /// Place across or up of one of the rows or columns.
    pub(super) fn place(index: usize, side: usize) -> f64 {
        (index as f64 + 0.5) / side as f64 * 2.0 - 1.0
    }

    /// Rows or columns whose middle lies within an extent, from the first of the picture.
    fn within([low, high]: [f64; 2], side: usize) -> Range<usize> {
        let at = |place: f64| (place + 1.0) / 2.0 * side as f64 - 0.5;
        let [first, end] = [at(low).ceil(), at(high).floor() + 1.0];
        let bound = |at: f64| numbers::whole::<usize>(at.clamp(0.0, side as f64));
        bound(first)..bound(end)
    }

    /// Where the line of a place begins.
    fn start(&self, across: f64, up: f64) -> DVec3 {
        let [right, _, top] = self.axes;
        (self.centre[0] + across * self.half) * right + (self.centre[2] + up * self.half) * top
    }
}

/// A surface in the view.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surface {
    /// Into the picture, m.
    pub(super) depth: f32,
    /// Index of its object.
    pub(super) object: usize,
    /// Unit normal to the right, into the picture and upwards.
    pub(super) normal: [f32; 3],
}

/// A body in the view.
#[derive(Debug)]
struct Body {
    /// Index among the placed surfaces.
    placed: u32,
    columns: Range<usize>,
    rows: Range<usize>,
    /// Depth of its point in front, m.
    depth: f32,
    strip: Option<Strip>,
}

/// The strip of the picture along the longest way through a body that slants: columns that bound it at place 0, and
/// their change with the place upwards.
#[derive(Debug)]
struct Strip {
    columns: [f64; 2],
    slope: f64,
}

impl Strip {
    /// The strip of a body, by the points of it that are farthest right, left, up and down; `None` where it is as upright
    /// or level as its box.
    fn of(sample: &Sample, placed: &Placed, view: &View) -> Option<Self> {
        let [right, _, up] = view.axes;
        let ends = |along: DVec3| {
            let [a, b] = [along, -along].map(|it| sample.farthest_of_placed(placed, it));
            [right.dot(a - b), up.dot(a - b)]
        };
        let [level, upright] = [ends(right), ends(up)];
        let [x, z] = if level[0] > upright[1] { level } else { upright };
        let slope = x / z;
        if !(SLANTED..1.0 / SLANTED).contains(&slope.abs()) {
            return None;
        }
        let middle = view.centre[0] - slope * view.centre[2];
        let extent = sample.extent_of_placed(placed, right - slope * up);
        Some(Self { columns: extent.map(|end| (end - middle) / view.half), slope })
    }
}

/// The bodies in front, by column and row of a picture of `side` columns.
#[derive(Debug)]
pub(super) struct Impostors<'s> {
    sample: &'s Sample,
    view: &'s View,
    side: usize,
    front: Vec<u32>,
}

impl<'s> Impostors<'s> {
    /// True for each object that can be drawn so: opaque ones of exact shapes that cross no others.
    pub(super) fn objects(sample: &Sample, translucent: &[bool]) -> Vec<bool> {
        let mut drawn: Vec<bool> = translucent.iter().map(|it| !it).collect();
        let mut has_shapes = vec![false; drawn.len()];
        for component in &sample.triangle_component {
            drawn[sample.object_of(*component)] = false;
        }
        for (at, placed) in (0_u32..).zip(&sample.placed) {
            let object = sample.object_of(placed.component);
            let is_exact = sample.prototypes[placed.prototype as usize].shape.is_some();
            drawn[object] &= is_exact && sample.partners.of(at).is_none();
            has_shapes[object] = true;
        }
        drawn.iter().zip(has_shapes).map(|(drawn, has)| *drawn && has).collect()
    }

    /// Draws the bodies of some objects.
    pub(super) fn draw(sample: &'s Sample, objects: &[bool], view: &'s View, side: usize) -> Self {
        let [right, into, up] = view.axes;
        let in_view = |(placed, it): (u32, &_)| {
            let extent = |along: DVec3, middle: f64| {
                sample.extent_of_placed(it, along).map(|end| (end - middle) / view.half)
            };
            let [bottom, top] = extent(up, view.centre[2]);
            let [front, _] = sample.extent_of_placed(it, into);
            Body {
                placed,
                strip: Strip::of(sample, it, view),
                columns: View::within(extent(right, view.centre[0]), side),
                // The first row is the uppermost.
                rows: View::within([-top, -bottom], side),
                depth: single(front),
            }
        };
        let mut bodies: Vec<Body> = (0_u32..)
            .zip(&sample.placed)
            .filter(|(_, it)| objects[sample.object_of(it.component)])
            .map(in_view)
            .collect();
        bodies.sort_by(|a, b| a.depth.total_cmp(&b.depth));
        let mut front = vec![NONE; side * side];
        front.par_chunks_mut(ROWS * side).enumerate().for_each(|(part, front)| {
            let first = part * ROWS;
            let rows = first..first + front.len() / side;
            let mut depths = vec![f32::INFINITY; front.len()];
            for body in &bodies {
                let placed = &sample.placed[body.placed as usize];
                for row in body.rows.start.max(rows.start)..body.rows.end.min(rows.end) {
                    let up = -View::place(row, side);
                    let strip = body
                        .strip
                        .as_ref()
                        .map(|it| View::within(it.columns.map(|end| end + it.slope * up), side));
                    let Range { start: left, end: right } = body.columns;
                    let strip = strip.unwrap_or(left..right);
                    for column in left.max(strip.start)..right.min(strip.end) {
                        let at = (row - first) * side + column;
                        if depths[at] <= body.depth {
                            continue;
                        }
                        let start = view.start(View::place(column, side), up);
                        let Some(entry) = sample.entry(placed, start, into) else { continue };
                        let depth = single(entry.distance);
                        if depth < depths[at] {
                            (depths[at], front[at]) = (depth, body.placed);
                        }
                    }
                }
            }
        });
        Self { sample, view, side, front }
    }

    /// Columns of the picture.
    pub(super) const fn side(&self) -> usize {
        self.side
    }

    /// The surface in front at a column and row.
    pub(super) fn at(&self, column: usize, row: usize) -> Option<Surface> {
        let placed = self.sample.placed.get(self.front[row * self.side + column] as usize)?;
        let [right, into, up] = self.view.axes;
        let place = |index| View::place(index, self.side);
        let start = self.view.start(place(column), -place(row));
        let entry = self.sample.entry(placed, start, into)?;
        let normal = [right, into, up].map(|axis| single(axis.dot(entry.normal)));
        let object = self.sample.object_of(placed.component);
        Some(Surface { depth: single(entry.distance), object, normal })
    }
}
