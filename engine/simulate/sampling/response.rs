//! How a change of a cell's result changes what pixels record: the openings of the sample mask by
//! mask step, and the blurred windows of the analyser.

use super::error_budget::safety;
use super::hardening::Hardening;
use super::lattice::Lattice;
use super::strips::StripResponses;
use super::windows::{Landed, Windows};
use beamlet_core::numbers::single;
use beamlet_interface::{BeamletGeometry, NO_LIGHT};
use beamlet_model::optics::{Mask, Openings, Optics};
use std::cmp::Ordering;
use std::f64::consts::FRAC_1_SQRT_2;

/// A border of pixels is in an aperture if it is farther than this from its ends, periods of the mask: where an aperture
/// is as wide as a pixel both are the same place, rounded.
const AT_EDGE: f64 = 1e-6;
/// Mask steps closer to one another than this share of an aperture see the same.
const STEPS_APART: f64 = 1.0 / 16.0;
/// An opening is seen this many standard deviations beyond its edges.
const SOFT_EDGE: f64 = 2.0;

/// Light that a cell sends through the masks, per mask step and window.
#[derive(Debug, Clone)]
pub(crate) struct Response {
    /// Windows that light passes: apertures of the detector mask or pixels; behind a detector mask
    /// whose bars leak those, and pixels; of a detector that blurs pixels, beside parts of pixels for a measured kernel.
    pub(crate) windows: Vec<Windows>,
    /// Standard deviation of the blur on the analyser, m.
    pub(super) blur: f32,
    /// From the cell plane to the analyser.
    pub(crate) magnification: f32,
    /// Landing point of an undeflected ray through the centre of a beamlet, from the centre of the
    /// nearest window, m, by beamlet of the lattice.
    landing: Vec<f32>,
    /// Openings by mask step in the cell plane, from the nearest period of the sample mask, m; none
    /// without a sample mask.
    pub(super) openings: Vec<Opening>,
    /// Responses behind apertures that end along z; none of slits.
    pub(crate) strips: Option<StripResponses>,
    /// Length after which openings repeat, m.
    pattern: f32,
    /// Mask steps that differ enough to count.
    steps: usize,
    /// Beamlet's centre from the centre of the nearest period of the sample mask, m.
    mask_offset: Vec<f32>,
    /// Reduction of each side of an opening by the shadow of thick bars, m, by beamlet.
    shadow: Vec<f32>,
    /// Share of the light that the bars of the sample mask let through; 0 where that is too little
    /// to count.
    pub(crate) leak: f32,
    /// Light that passes an optical depth.
    pub(crate) hardening: Hardening,
    /// Half the period of the lattice, m.
    half_period: f32,
    /// Recorded value per metre of open cell plane.
    pub(crate) weight: f32,
}

/// An interval of x of a beamlet that a mask step opens.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Opening {
    pub(crate) step: u32,
    pub(crate) x: [f32; 2],
}

impl Response {
    /// For the scene that is traced. `leaks`: shares of the light of all energies that the bars of the
    /// sample mask and of the detector mask let through. `hardening`: of the beam.
    /// `list`: index of the list of mask offsets of a view.
    #[must_use]
    pub(crate) fn new(
        optics: &Optics,
        lattice: &Lattice,
        (leaks, hardening): ([f64; 2], &Hardening),
        list: usize,
    ) -> Self {
        let Optics { rotation, analyser, detector, .. } = optics;
        let offsets = &optics.offsets.lists()[list];
        let beamlets = lattice.beamlet_geometry(optics);
        // Of the whole spot: recorded values are sums over its parts.
        let spot = |part: &beamlet_model::spot::PlacedPart| {
            part.share * (part.offset[0].powi(2) + part.deviation[0].powi(2))
        };
        let spot = optics.spot.placed().iter().map(spot).sum::<f64>().sqrt();
        let edge = optics.cutting_plane();
        let magnified = spot * (edge / rotation - 1.0) * analyser / edge;
        let blur = magnified.max(1e-4 * optics.windows().period[0]);
        let soft =
            SOFT_EDGE * optics.spot.narrowest(0) * (rotation - lattice.plane).abs() / rotation;
        let hard = optics.sample_mask.is_none();
        let beams = optics.beamlets();
        let (openings, pattern) = match optics.passed() {
            Some(passed) => {
                let offsets = told_apart(offsets, STEPS_APART * passed.narrowest(0));
                (openings_of_steps(&passed, &offsets, soft), passed.period[0])
            }
            None => (Vec::new(), beams.period[0]),
        };
        let steps = openings.last().map_or(1, |last| last.step as usize + 1);
        // Bars that let less light through than lines may err by are opaque.
        let least = safety(steps) * optics.sampling.tolerances().light;
        let [leak, window_leak] = leaks.map(|leak| if leak < least { 0.0 } else { single(leak) });
        let mut response = Self {
            windows: windows_of(optics, &beamlets, window_leak, blur),
            strips: None,
            blur: single(blur),
            magnification: single(analyser / lattice.plane),
            landing: beamlets.iter().map(|c| landing(optics, c)).collect(),
            steps,
            openings,
            mask_offset: beamlets.iter().map(|c| c.sample_offset).collect(),
            // The shadow of bars that leak is no darker than they are.
            shadow: beamlets
                .iter()
                .map(|c| if hard || leak > 0.0 { 0.0 } else { shadow(optics, c.slope) })
                .collect(),
            leak,
            pattern: single(pattern),
            hardening: hardening.clone(),
            half_period: single(0.5 * lattice.period),
            weight: single(detector.distance / (lattice.plane * detector.pitch[0])),
        };
        let leaks = [leak, window_leak];
        response.strips = StripResponses::new(optics, &response, list, soft, leaks);
        response
    }

    /// The response of other windows, behind bars with another leak, at a number of mask steps.
    pub(super) fn with_windows(&self, windows: Vec<Windows>, leak: f32, steps: usize) -> Self {
        Self { windows, leak, steps, ..self.clone() }
    }

    /// True if at each mask step both masks are open nearly where they are at a step of another response, with the same
    /// light through bars and their shadows: edges are nearer to its edges than a share of the narrower aperture.
    pub(super) fn is_near(&self, other: &Self, share: f32) -> bool {
        let is_near = |a: &[f32; 2], b: &[f32; 2]| {
            let narrower = (a[1] - a[0]).min(b[1] - b[0]);
            (a[0] - b[0]).abs().max((a[1] - b[1]).abs()) < share * narrower
        };
        let windows_are_near = |(a, b): (&Windows, &Windows)| {
            a.share.to_bits() == b.share.to_bits()
                && a.ends.len() == b.ends.len()
                && a.ends.iter().zip(&b.ends).all(|(a, b)| is_near(a, b))
        };
        self.leak.to_bits() == other.leak.to_bits()
            && self.shadow == other.shadow
            && self.windows.len() == other.windows.len()
            && self.windows.iter().zip(&other.windows).all(windows_are_near)
            && self
                .openings
                .iter()
                .all(|own| other.openings.iter().any(|it| is_near(&own.x, &it.x)))
    }

    /// Width of all openings and windows, m: where it is larger, more light counts.
    fn open_width(&self) -> f32 {
        let openings = self.openings.iter().map(|opening| opening.x[1] - opening.x[0]);
        let windows = self.windows.iter().flat_map(|it| &it.ends).map(|[low, high]| high - low);
        openings.chain(windows).sum()
    }

    /// Order by [`Self::open_width`], the widest first, then by edges and light through bars.
    pub(super) fn order(&self, other: &Self) -> Ordering {
        let edges = |it: &Self| {
            let openings = it.openings.iter().flat_map(|opening| opening.x);
            let windows = it
                .windows
                .iter()
                .flat_map(|windows| windows.ends.iter().flatten().copied().chain([windows.share]));
            let all = openings.chain(windows).chain(it.shadow.iter().copied()).chain([it.leak]);
            all.map(f32::to_bits).collect::<Vec<u32>>()
        };
        let widths = other.open_width().total_cmp(&self.open_width());
        widths.then_with(|| edges(self).cmp(&edges(other)))
    }

    /// True if the windows are those of another response, behind the same bars of the sample mask.
    pub(super) fn has_windows_of(&self, other: &Self) -> bool {
        self.windows == other.windows && self.leak.to_bits() == other.leak.to_bits()
    }

    /// Largest change of the share of light that passes a window, per displacement, 1/m.
    pub(crate) fn steepest(&self) -> f64 {
        let shares: f32 = self.windows.iter().map(|windows| windows.share).sum();
        0.4 * f64::from(shares) / f64::from(self.blur)
    }

    /// Mask steps that differ enough to count.
    pub(crate) fn steps(&self) -> usize {
        self.steps
    }

    /// Share of the light behind the sample mask of a rectangle that a step opens to a share.
    pub(crate) fn lit(&self, open: f32) -> f32 {
        self.leak + (1.0 - self.leak) * open
    }

    /// Openings of the beamlet at `column` of the lattice, inside its period.
    pub(crate) fn openings(&self, column: usize) -> Vec<Opening> {
        self.openings_of(&self.openings, column)
    }

    /// The same of some openings from the nearest period of the sample mask.
    pub(crate) fn openings_of(&self, openings: &[Opening], column: usize) -> Vec<Opening> {
        let half = self.half_period;
        if openings.is_empty() {
            return vec![Opening { step: 0, x: [-half, half] }];
        }
        let mut all = Vec::new();
        for Opening { step, x } in openings {
            let [low, high] = x.map(|x| x - self.mask_offset[column]);
            let [low, high] = [low + self.shadow[column], high - self.shadow[column]];
            let mut k = ((-half - high) / self.pattern).ceil();
            while low + k * self.pattern < half {
                let shift = k * self.pattern;
                let x = [(low + shift).max(-half), (high + shift).min(half)];
                if x[1] > x[0] {
                    all.push(Opening { step: *step, x });
                }
                k += 1.0;
            }
        }
        all
    }

    /// Landing point of light of a beamlet displaced by `displacement`, from the centre of a
    /// window, m.
    pub(crate) fn landing(&self, column: usize, x: f32, displacement: f32) -> f32 {
        self.magnification * x + displacement + self.landing[column]
    }

    /// Largest change of the light in any pixel between two results of the beamlet at `column`: light that passes the
    /// sample, spread over 2 `half`.
    pub(crate) fn change(&self, column: usize, results: [Landed; 2], half: f32) -> f32 {
        let of = |windows: &Windows| windows.share * windows.change(column, results, half);
        self.windows.iter().map(of).sum()
    }
}

/// Windows of the optics by the share of the light that they pass, blurred by `blur`, m. Light that leaks
/// through the bars of the detector mask is recorded in all of a pixel; light that passes an aperture is parted
/// where a border of pixels lies in it.
fn windows_of(optics: &Optics, beamlets: &[BeamletGeometry], leak: f32, blur: f64) -> Vec<Windows> {
    let leak = if optics.detector_mask.is_some() { leak } else { 0.0 };
    let to_analyser = optics.analyser / optics.detector.distance;
    let of_detector = optics.column_blur * to_analyser;
    // Light beside the detector is blurred into it.
    let beside = NO_LIGHT * of_detector;
    let width = f64::from(optics.detector.pixels[0]) * optics.analyser_pixel();
    let ends = |aside: f64| {
        move |c: &BeamletGeometry| {
            let first = -(f64::from(c.pixel) + 0.5) * optics.analyser_pixel();
            let centre = f64::from(landing(optics, c)) + aside - f64::from(c.pixel_offset);
            [first + centre - beside, first + centre + width + beside]
        }
    };
    // Pixels of a detector that blurs have soft borders, which reach into apertures. Of a measured kernel parts of pixels
    // are windows as well: they see light that moves within a pixel.
    let softens = optics.column_parts > 1;
    let alone = softens && optics.detector_mask.is_none() && of_detector > 0.0;
    let mut windows = Vec::new();
    if !alone {
        let own = beamlets.iter().map(ends(0.0));
        windows.push(Windows::new(&optics.windows(), blur, 1.0 - leak, Vec::new(), own));
    }
    let parted = if softens || borders_lie_in_apertures(optics, beamlets) { 1.0 } else { leak };
    if parted > 0.0 {
        let aside: Vec<f32> = beamlets.iter().map(|c| pixel_aside(optics, c)).collect();
        let own: Vec<_> =
            beamlets.iter().zip(&aside).map(|(c, aside)| ends((*aside).into())(c)).collect();
        let soft = if softens { blur.hypot(of_detector) } else { blur };
        let pixels = optics.whole_pixel_windows();
        // Beamlets side by side err alike, and a pixel has the light of as many as there are pixels that share the light
        // of one.
        let half = 0.5 * pixels.period[0] / soft;
        let share = if alone { single(1.0 / libm::erf(half * FRAC_1_SQRT_2)) } else { parted };
        windows.push(Windows::new(&pixels, soft, share, aside, own.into_iter()));
    }
    windows
}

/// Landing point of an undeflected ray through the centre of a beamlet, from the centre of the nearest aperture of the
/// detector mask, or of the nearest part of a pixel without one, m.
fn landing(optics: &Optics, c: &BeamletGeometry) -> f32 {
    if optics.detector_mask.is_some() { c.aperture_offset } else { c.pixel_offset }
}

/// Place that [`landing`] counts from, from the centre of the pixel of the detector that takes the light of a beamlet, m on
/// the analyser.
fn pixel_aside(optics: &Optics, c: &BeamletGeometry) -> f32 {
    let parts = optics.column_parts;
    let part = f64::from(c.pixel.rem_euclid(parts.cast_signed()));
    let to_pixel = (part + 0.5 - 0.5 * f64::from(parts)) * optics.analyser_pixel();
    c.pixel_offset - landing(optics, c) + single(to_pixel)
}

/// True if a border between pixels lies in an aperture of the detector mask, seen from the source.
fn borders_lie_in_apertures(optics: &Optics, beamlets: &[BeamletGeometry]) -> bool {
    if optics.detector_mask.is_none() {
        return false;
    }
    let (apertures, pixel) = (optics.windows(), optics.whole_pixel_windows().period[0]);
    let edge = AT_EDGE * apertures.period[0];
    let parts = |c: &BeamletGeometry| {
        // From the centre of the period of the mask; others are whole pixels away.
        let border = -f64::from(pixel_aside(optics, c)) - 0.5 * pixel;
        let mut ends = apertures.ends();
        ends.any(|[low, high]| {
            let next = border + ((low + edge - border) / pixel).ceil() * pixel;
            next < high - edge
        })
    };
    beamlets.iter().any(parts)
}

/// Openings at each of the offsets, m; `soft`: how far an opening is seen beyond its edges, m.
pub(super) fn openings_of_steps(openings: &Openings, offsets: &[f64], soft: f64) -> Vec<Opening> {
    let of_step = |(step, offset): (u32, &f64)| {
        openings.displaced(*offset, soft).map(move |x| Opening { step, x: x.map(single) })
    };
    (0..).zip(offsets).flat_map(of_step).collect()
}

/// Reduction of each side of an aperture by the shadow of thick bars of the sample mask, m, at an angle
/// of this slope; of slanted walls the smaller one.
fn shadow(optics: &Optics, slope: f32) -> f32 {
    let mask = optics.sample_mask.as_ref();
    let thickness = mask.and_then(Mask::side_shadow).unwrap_or_default();
    let wall = mask.map_or(0.0, Mask::wall_slope);
    0.5 * single(thickness) * (slope.abs() - single(wall.abs())).abs()
}

/// Offsets of the sample mask farther apart than `least`, m: two accurate steps make the steps between
/// them accurate.
fn told_apart(offsets: &[f64], least: f64) -> Vec<f64> {
    let mut sorted = offsets.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let mut kept: Vec<f64> = Vec::new();
    for offset in sorted {
        if kept.last().is_none_or(|last| offset - last > least) {
            kept.push(offset);
        }
    }
    kept
}
