//! Light behind bodies of facets, integrated over the images of their corners and edges: heights lie in panels between
//! all corners, x in pieces between all edges, so that no part is too thin.
//!
//! A panel is a share of a row at the rotation centre. Its light is that of the plane through its middle, and it is cut
//! in three until that changes no value. In a plane, rays at both quarters of a piece give its depth and displacement,
//! and light through masks has a closed form. Masks are sheets; the source is moved behind the sample, which is thin
//! against its distance.

use super::normal::{SIGMA_PER_FWHM, density};
use super::pieces::{Piece, cumulative};
use super::rays::{Order, Sample, Trace};
use super::surfaces::Body;
use super::vector::Vector;
use rayon::prelude::*;
use std::iter::zip;

/// Standard deviations of the spot that count.
const REACH: f64 = 6.0;
/// Pieces that differ in their surfaces are not cut below this, m.
const NARROW: f64 = 1e-9;
/// Corners within this share of a row have one panel between them, which is cut where their light differs.
const CLOSE: f64 = 1e-4;
/// Rows and columns beside the detector whose light counts where matter refracts, and where it does not.
const BESIDE: [f64; 2] = [1.0, 0.05];
/// Refraction that moves no light by as much, as a decrement.
const WEAK: f64 = 1e-10;

/// A sheet whose apertures are centred on the pixels seen from the source.
#[derive(Debug, Clone, Copy)]
pub struct Sheet {
    /// From the source, m.
    pub distance: f64,
    /// Widths of apertures along x and z, as parts of a pixel; 2 along z: slits.
    pub open: [f64; 2],
    /// Transmission of bars.
    pub leak: f64,
}

/// Source, sheets and detector.
#[derive(Debug, Clone)]
pub struct Beam {
    /// Source to rotation centre, m.
    pub source: f64,
    /// Source to detector, m.
    pub detector: f64,
    /// FWHM of the focal spot in x and z, m.
    pub spot: [f64; 2],
    /// Columns and rows.
    pub pixels: [u32; 2],
    /// Pitch in x and z, m.
    pub pitch: [f64; 2],
    /// Sheet before the sample.
    pub sample_mask: Option<Sheet>,
    /// Sheet on the detector.
    pub detector_mask: Option<Sheet>,
    /// Displacements of the first sheet along x, m.
    pub offsets: Vec<f64>,
}

/// How finely light is integrated.
#[derive(Debug, Clone, Copy)]
pub struct Fineness {
    /// Panels of a row, before those that corners part.
    pub panels: f64,
    /// Panels are cut in three until their light changes by less than this, share of open beam.
    pub change: f64,
}

/// Bodies in the frame of a view, and the images of their edges from the source on the plane of the rotation centre.
struct View<'a> {
    beam: &'a Beam,
    sample: Sample,
    order: Order,
    /// Ends of edges, x and z, m.
    edges: Vec<[[f64; 2]; 2]>,
    /// Standard deviation of the spot along x, m.
    spot: f64,
    /// Standard deviation of the image of the spot along z on the detector, m.
    blur: f64,
    /// x of the light that counts on the plane of the rotation centre, m.
    width: [f64; 2],
}

/// Light of a view, open beam 1: `[step][row][column]`.
#[must_use]
pub fn light(beam: &Beam, bodies: &[Body], order: Order, how: Fineness) -> Vec<f64> {
    let view = View::new(beam, bodies, order);
    let magnification = beam.detector / beam.source;
    let row = beam.pitch[1] / magnification;
    let half = (0.5 * f64::from(beam.pixels[1]) + beside(bodies)) * row
        + REACH * view.blur / magnification;
    let mut heights: Vec<f64> = view.edges.iter().flatten().map(|end| end[1]).collect();
    heights.retain(|z| z.abs() < half);
    heights.extend([-half, half]);
    heights.extend(
        (0..=beam.pixels[1]).map(|r| (f64::from(r) - 0.5 * f64::from(beam.pixels[1])) * row),
    );
    heights.sort_by(f64::total_cmp);
    let heights = grouped(&heights, CLOSE * row);
    let panels: Vec<[f64; 2]> = heights
        .windows(2)
        .flat_map(|ends| {
            let count = ((ends[1] - ends[0]) / row * how.panels).ceil().max(1.0);
            let step = (ends[1] - ends[0]) / count;
            (0..count as u32)
                .map(move |k| [0.0, 1.0].map(|end| ends[0] + step * (f64::from(k) + end)))
        })
        .collect();
    let values = beam.offsets.len() * (beam.pixels[0] * beam.pixels[1]) as usize;
    let add = |mut sum: Vec<f64>, part: Vec<f64>| {
        zip(&mut sum, part).for_each(|(sum, part)| *sum += part);
        sum
    };
    let of = |panel: &[f64; 2]| {
        view.refined(*panel, &view.pieces(0.5 * (panel[0] + panel[1])), how.change, 7)
    };
    panels.par_iter().map(of).reduce(|| vec![0.0; values], add)
}

/// Rows and columns beside the detector whose light counts.
fn beside(bodies: &[Body]) -> f64 {
    BESIDE[usize::from(bodies.iter().all(|body| body.delta < WEAK))]
}

/// First and last of each group of heights, in order, that lie within `near`.
fn grouped(heights: &[f64], near: f64) -> Vec<f64> {
    let mut ends: Vec<[f64; 2]> = Vec::new();
    for at in heights {
        match ends.last_mut() {
            Some([first, last]) if at - *first < near => *last = *at,
            _ => ends.push([*at; 2]),
        }
    }
    let mut all: Vec<f64> = ends.into_iter().flatten().collect();
    all.dedup();
    all
}

impl<'a> View<'a> {
    fn new(beam: &'a Beam, bodies: &[Body], order: Order) -> Self {
        let image = |v: Vector| [v[0], v[2]].map(|at| at * beam.source / (v[1] + beam.source));
        let mut edges = Vec::new();
        for mesh in bodies.iter().map(|body| &body.mesh) {
            for [a, b, c] in (0..mesh.triangles.len()).map(|it| mesh.corners(it).map(image)) {
                edges.extend([[a, b], [b, c], [c, a]]);
            }
        }
        let sigma = beam.spot.map(|it| it * SIGMA_PER_FWHM);
        let magnification = beam.detector / beam.source;
        let columns = 0.5 * f64::from(beam.pixels[0]) + beside(bodies);
        let half = columns * beam.pitch[0] / magnification
            + REACH * sigma[0] * (1.0 - 1.0 / magnification);
        Self {
            beam,
            sample: Sample::new(bodies, beam.source, 0.0),
            order,
            edges,
            spot: sigma[0],
            blur: sigma[1] * (magnification - 1.0),
            width: [-half, half],
        }
    }

    /// Light of a panel with the pieces of the plane through its middle, by parts of it where that changes.
    fn refined(
        &self,
        [low, high]: [f64; 2],
        pieces: &[Piece],
        change: f64,
        times: u32,
    ) -> Vec<f64> {
        let whole = self.panel([low, high], pieces);
        if times == 0 {
            return whole;
        }
        let third = (high - low) / 3.0;
        let ends = [0.0, 1.0, 2.0].map(|k| [low + k * third, low + (k + 1.0) * third]);
        let [below, above] = [ends[0], ends[2]].map(|part| self.pieces(0.5 * (part[0] + part[1])));
        let pieces = [below.as_slice(), pieces, above.as_slice()];
        let parts: Vec<Vec<f64>> =
            zip(ends, pieces).map(|(part, pieces)| self.panel(part, pieces)).collect();
        let sum: Vec<f64> =
            (0..whole.len()).map(|k| parts.iter().map(|part| part[k]).sum()).collect();
        if zip(&sum, &whole).all(|(a, b)| (a - b).abs() < change) {
            return sum;
        }
        let parts =
            zip(ends, pieces).map(|(part, pieces)| self.refined(part, pieces, change, times - 1));
        parts.reduce(|a, b| zip(a, b).map(|(a, b)| a + b).collect()).expect("three parts")
    }

    /// Light of a panel with the pieces of a plane.
    fn panel(&self, [low, high]: [f64; 2], pieces: &[Piece]) -> Vec<f64> {
        let Beam { pixels: [columns, rows], offsets, .. } = self.beam;
        let mut sum = vec![0.0; offsets.len() * (columns * rows) as usize];
        for piece in pieces {
            // With and without the apertures of each sheet.
            for sheets in [[false, false], [true, false], [false, true], [true, true]] {
                let leaks = [self.beam.sample_mask, self.beam.detector_mask]
                    .map(|it| it.map_or(1.0, |it| it.leak));
                let share: f64 = zip(sheets, leaks)
                    .map(|(open, leak)| if open { 1.0 - leak } else { leak })
                    .product();
                if share == 0.0 {
                    continue;
                }
                let heights: Vec<f64> = (0..*rows)
                    .map(|row| share * self.height([low, high], piece.moved_z, row, sheets))
                    .collect();
                if heights.iter().all(|it| *it < 1e-14) {
                    continue;
                }
                for (step, offset) in offsets.iter().enumerate() {
                    for column in 0..*columns {
                        let width = self.breadth(piece, column, *offset, sheets);
                        for (row, height) in heights.iter().enumerate() {
                            let at =
                                (step * *rows as usize + row) * *columns as usize + column as usize;
                            sum[at] += width * height;
                        }
                    }
                }
            }
        }
        sum
    }

    /// Part of a row that receives the light of a panel through the apertures of sheets.
    fn height(&self, panel: [f64; 2], moved: f64, row: u32, [first, second]: [bool; 2]) -> f64 {
        let beam = self.beam;
        let pitch = beam.pitch[1];
        let centre = (0.5 * f64::from(beam.pixels[1]) - 0.5 - f64::from(row)) * pitch;
        let open = |sheet: Option<Sheet>| 0.5 * sheet.map_or(1.0, |it| it.open[1]).min(1.0);
        let far = beam.detector / beam.source;
        let mut parts = vec![panel.map(|z| z * far)];
        if let Some(sheet) = beam.sample_mask.filter(|it| first && it.open[1] < 1.0) {
            // Apertures lie about every row, those beside the detector too.
            let [low, high] = parts[0];
            let around = (-1..=i32::try_from(beam.pixels[1]).expect("few rows")).map(|r| {
                let middle = (0.5 * f64::from(beam.pixels[1]) - 0.5 - f64::from(r)) * pitch;
                let half = open(Some(sheet)) * pitch;
                [low.max(middle - half), high.min(middle + half)]
            });
            parts = around.filter(|[low, high]| high > low).collect();
        }
        let half = pitch * if second { open(beam.detector_mask) } else { 0.5 };
        let window = [centre - half - moved, centre + half - moved];
        parts.into_iter().map(|part| self.overlap(part, window)).sum::<f64>() / pitch
    }

    /// Length of a stretch behind the blur along z that lies in a window.
    fn overlap(&self, [low, high]: [f64; 2], [from, to]: [f64; 2]) -> f64 {
        if self.blur == 0.0 {
            return (high.min(to) - low.max(from)).max(0.0);
        }
        // Integral of the distribution function.
        let integral = |v: f64| v * cumulative(v) + density(v);
        let between =
            |end: f64| integral((end - low) / self.blur) - integral((end - high) / self.blur);
        self.blur * (between(to) - between(from))
    }

    /// Light of a piece in a column through apertures of sheets, in pitches.
    fn breadth(&self, piece: &Piece, column: u32, offset: f64, [first, second]: [bool; 2]) -> f64 {
        let beam = self.beam;
        let (pitch, far) = (beam.pitch[0], beam.detector / beam.source);
        let centre = (f64::from(column) + 0.5 - 0.5 * f64::from(beam.pixels[0])) * pitch;
        let half = 0.5
            * pitch
            * if second { beam.detector_mask.map_or(1.0, |it| it.open[0]) } else { 1.0 };
        let window = [centre - half, centre + half];
        // Ends of the piece on the detector, from the centre of the source, and how far the spot moves them.
        let ends = [0, 1].map(|k| piece.x[k] * far + piece.moved[k]);
        let reach = REACH * self.spot * (far - 1.0);
        if ends[0].max(ends[1]) < window[0] - reach || ends[0].min(ends[1]) > window[1] + reach {
            return 0.0;
        }
        let Some(sheet) = beam.sample_mask.filter(|_| first) else {
            return self.between(piece, None, window) * far / pitch;
        };
        // Apertures whose images on the plane of the rotation centre may meet the piece.
        let scale = sheet.distance / beam.source;
        let period = pitch * sheet.distance / beam.detector;
        let shift = offset + (0.5 - 0.5 * f64::from(beam.pixels[0])) * period;
        let reach = REACH * self.spot * (1.0 - scale) + 0.5 * period;
        let at = |x: f64, side: f64| ((x * scale + side * reach - shift) / period).round() as i64;
        let apertures = at(piece.x[0], -1.0)..=at(piece.x[1], 1.0);
        let of = |aperture: i64| {
            let middle = aperture as f64 * period + shift;
            let half = 0.5 * sheet.open[0] * period;
            self.between(piece, Some(([middle - half, middle + half], scale)), window)
        };
        apertures.map(of).sum::<f64>() * far / pitch
    }

    /// Light of a piece between the ends of an aperture, on a sheet at a share of the distance of the rotation centre,
    /// and those of a window on the detector; m on the plane of the rotation centre.
    fn between(&self, piece: &Piece, aperture: Option<([f64; 2], f64)>, window: [f64; 2]) -> f64 {
        let far = self.beam.detector / self.beam.source;
        let [low, high] = piece.x;
        let moved =
            |x: f64| piece.moved[0] + (piece.moved[1] - piece.moved[0]) * (x - low) / (high - low);
        let slope = far + (piece.moved[1] - piece.moved[0]) / (high - low);
        let on_plane = |at: f64| low + (at - low * far - piece.moved[0]) / slope;
        let cut = |[a, b]: [f64; 2]| [a.min(b).max(low), a.max(b).min(high)];
        let lands = window.map(on_plane);
        let passes = aperture.map(|(ends, scale)| ends.map(|at| at / scale));
        if self.spot == 0.0 {
            let [from, to] = cut(lands);
            let [a, b] = passes.map_or([from, to], cut);
            let share = |x: f64| (x - low) / (high - low);
            return (high - low) * piece.passed(share(from.max(a)), share(to.min(b)));
        }
        // Edges are as broad as their images of the spot.
        let mut cuts = vec![low, high];
        let mut edge = |at: f64, width: f64| {
            let steps = (-12..=12).map(|step| at + 0.5 * f64::from(step) * width);
            cuts.extend(steps.filter(|x| *x > low && *x < high));
        };
        lands.into_iter().for_each(|at| edge(at, self.spot * (far - 1.0) / slope));
        if let (Some(ends), Some((_, scale))) = (passes, aperture) {
            ends.into_iter().for_each(|at| edge(at, self.spot * (1.0 - scale) / scale));
        }
        cuts.sort_by(f64::total_cmp);
        let from_all = |x: f64| {
            let at = x * far + moved(x);
            let mut ends = [window[1], window[0]].map(|end| (at - end) / (far - 1.0));
            if let Some(([a, b], scale)) = aperture {
                let through = [a, b].map(|end| (end - x * scale) / (1.0 - scale));
                ends = [ends[0].max(through[0]), ends[1].min(through[1])];
            }
            let [a, b] = ends.map(|end| cumulative(end / self.spot));
            (b - a).max(0.0) * piece.at((x - low) / (high - low))
        };
        // Gauss's rule of three points.
        let rule = |ends: &[f64]| {
            let (middle, half) = (0.5 * (ends[0] + ends[1]), 0.5 * (ends[1] - ends[0]));
            if half == 0.0 {
                return 0.0;
            }
            let aside = half * 0.6_f64.sqrt();
            half * (5.0 * (from_all(middle - aside) + from_all(middle + aside))
                + 8.0 * from_all(middle))
                / 9.0
        };
        cuts.windows(2).map(rule).sum()
    }

    /// Pieces of the plane at a height.
    fn pieces(&self, height: f64) -> Vec<Piece> {
        let [low, high] = self.width;
        let mut cuts = vec![low, high];
        for &[a, b] in &self.edges {
            if (a[1] > height) != (b[1] > height) {
                let x = a[0] + (b[0] - a[0]) * ((height - a[1]) / (b[1] - a[1]));
                cuts.extend(Some(x).filter(|x| *x > low && *x < high));
            }
        }
        cuts.sort_by(f64::total_cmp);
        cuts.dedup_by(|a, b| *a - *b < 1e-13);
        let mut pieces = Vec::new();
        for ends in cuts.windows(2) {
            self.cut(height, [ends[0], ends[1]], 24, &mut pieces);
        }
        pieces
    }

    /// Pieces between two x: halved where rays at both quarters meet other surfaces, or in another order.
    fn cut(&self, height: f64, [low, high]: [f64; 2], times: u32, pieces: &mut Vec<Piece>) {
        let [a, b] = [0.25, 0.75].map(|share| self.trace(low + share * (high - low), height));
        let alike = a.met.len() == b.met.len() && zip(&a.met, &b.met).all(|(a, b)| a.0 == b.0);
        let long = !a.met.is_empty()
            && high - low > 0.25 * self.beam.pitch[0] * self.beam.source / self.beam.detector;
        if times > 0 && (long || (!alike && high - low > NARROW)) {
            let middle = 0.5 * (low + high);
            self.cut(height, [low, middle], times - 1, pieces);
            self.cut(height, [middle, high], times - 1, pieces);
            return;
        }
        let ends = |a: f64, b: f64| [1.5 * a - 0.5 * b, 1.5 * b - 0.5 * a];
        pieces.push(Piece {
            x: [low, high],
            depth: ends(a.optical_depth, b.optical_depth),
            moved: ends(a.displacement[0], b.displacement[0]),
            moved_z: 0.5 * (a.displacement[1] + b.displacement[1]),
        });
    }

    fn trace(&self, x: f64, height: f64) -> Trace {
        let Beam { source, detector, .. } = self.beam;
        let direction = [x / source, 1.0, height / source];
        self.sample.trace([0.0, -source, 0.0], direction, detector - source, self.order)
    }
}
