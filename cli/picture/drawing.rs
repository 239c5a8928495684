//! A drawing: lines, areas, words and blocks of pixels, in the order they are painted.

use super::colour::Rgb;
use super::font;
use beamlet::cli_support::printed;

/// Black of lines and words.
pub(crate) const INK: Rgb = [34, 34, 40];
/// Colour of grid lines and notes.
pub(crate) const GREY: Rgb = [120, 120, 128];
/// Colour of faint lines.
pub(crate) const FAINT: Rgb = [214, 214, 220];

/// Left, top, width, height.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Area {
    pub(crate) left: f64,
    pub(crate) top: f64,
    pub(crate) width: f64,
    pub(crate) height: f64,
}

impl Area {
    pub(crate) const fn new(left: f64, top: f64, width: f64, height: f64) -> Self {
        Self { left, top, width, height }
    }

    pub(crate) fn right(&self) -> f64 {
        self.left + self.width
    }

    pub(crate) fn bottom(&self) -> f64 {
        self.top + self.height
    }

    pub(crate) fn corners(&self) -> Vec<[f64; 2]> {
        let (right, bottom) = (self.right(), self.bottom());
        vec![[self.left, self.top], [right, self.top], [right, bottom], [self.left, bottom]]
    }
}

/// The point of a text at its position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// How a path is painted.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Paint {
    /// Colour and opacity of the area.
    pub(crate) fill: Option<(Rgb, f64)>,
    /// Colour and width of the line.
    pub(crate) stroke: Option<(Rgb, f64)>,
    /// Dashes: on and off.
    pub(crate) dash: Option<f64>,
}

impl Paint {
    pub(crate) const fn line(colour: Rgb, width: f64) -> Self {
        Self { fill: None, stroke: Some((colour, width)), dash: None }
    }

    pub(crate) const fn dashed(colour: Rgb, width: f64, dash: f64) -> Self {
        Self { fill: None, stroke: Some((colour, width)), dash: Some(dash) }
    }

    pub(crate) const fn fill(colour: Rgb) -> Self {
        Self { fill: Some((colour, 1.0)), stroke: None, dash: None }
    }
}

/// One painted thing.
#[derive(Debug, Clone)]
pub(super) enum Item {
    Path { points: Vec<[f64; 2]>, closed: bool, paint: Paint, clip: Option<Area> },
    Disc { at: [f64; 2], radius: f64, paint: Paint },
    Text { at: [f64; 2], text: String, size: f64, colour: Rgb, anchor: Anchor, upwards: bool },
    Pixels { area: Area, columns: usize, pixels: Vec<Rgb> },
}

/// Shapes in units of one pixel at scale 1; x to the right, y downwards.
#[derive(Debug, Clone)]
pub(crate) struct Drawing {
    pub(crate) width: f64,
    pub(crate) height: f64,
    pub(super) items: Vec<Item>,
    clip: Option<Area>,
}

impl Drawing {
    pub(crate) const fn new(width: f64, height: f64) -> Self {
        Self { width, height, items: Vec::new(), clip: None }
    }

    /// Paths that follow are cut at this area.
    pub(crate) const fn clip(&mut self, area: Option<Area>) {
        self.clip = area;
    }

    pub(crate) fn path(&mut self, points: Vec<[f64; 2]>, closed: bool, paint: Paint) {
        if points.len() > 1 {
            self.items.push(Item::Path { points, closed, paint, clip: self.clip });
        }
    }

    pub(crate) fn line(&mut self, from: [f64; 2], to: [f64; 2], paint: Paint) {
        self.path(vec![from, to], false, paint);
    }

    pub(crate) fn area(&mut self, area: Area, paint: Paint) {
        self.path(area.corners(), true, paint);
    }

    pub(crate) fn disc(&mut self, at: [f64; 2], radius: f64, paint: Paint) {
        self.items.push(Item::Disc { at, radius, paint });
    }

    /// Words on the base line `at[1]`.
    pub(crate) fn text(
        &mut self,
        at: [f64; 2],
        text: impl Into<String>,
        size: f64,
        colour: Rgb,
        anchor: Anchor,
    ) {
        let text = printed::line(&text.into());
        self.items.push(Item::Text { at, text, size, colour, anchor, upwards: false });
    }

    /// Words that run upwards, centred.
    pub(crate) fn text_upwards(&mut self, at: [f64; 2], text: impl Into<String>, size: f64) {
        let (text, anchor) = (printed::line(&text.into()), Anchor::Middle);
        self.items.push(Item::Text { at, text, size, colour: INK, anchor, upwards: true });
    }

    /// A block of pixels, row 0 on top, each a rectangle of its own.
    pub(crate) fn pixels(&mut self, area: Area, columns: usize, pixels: Vec<Rgb>) {
        self.items.push(Item::Pixels { area, columns, pixels });
    }

    /// An arrow with a filled head at `to`.
    pub(crate) fn arrow(&mut self, from: [f64; 2], to: [f64; 2], colour: Rgb, width: f64) {
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        let length = dx.hypot(dy).max(1e-9);
        let (ux, uy) = (dx / length, dy / length);
        let (long, half) = (4.0 + 2.5 * width, 1.6 + 1.2 * width);
        let foot = [to[0] - ux * long, to[1] - uy * long];
        self.line(from, foot, Paint::line(colour, width));
        let head = vec![
            to,
            [foot[0] - uy * half, foot[1] + ux * half],
            [foot[0] + uy * half, foot[1] - ux * half],
        ];
        self.path(head, true, Paint::fill(colour));
    }
}

/// Width of a text at a size.
pub(crate) fn text_width(text: &str, size: f64) -> f64 {
    font::width(text, size)
}
