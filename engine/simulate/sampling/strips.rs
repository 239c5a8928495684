//! Light at a height behind masks whose apertures end along z, by strips: intervals of z with the same apertures along
//! x. Behind a strip of each mask light is that behind slits, times the share of the focal spot whose rays cross both
//! strips and reach a row.

use super::response::{Opening, Response, openings_of_steps};
use super::row_spread::normal_share;
use super::windows::Windows;
use beamlet_core::numbers::{self, single};
use beamlet_interface::NO_LIGHT;
use beamlet_model::optics::{Mask, Optics, Strips};
use std::ops::Range;

/// Strips of a round aperture: an audit weighs differences of light by them, and they keep the area of the aperture
/// (`measured_errors_behind_apertures_are_true_ones`).
const STRIPS: u32 = 8;

/// Responses of the strips of both masks.
#[derive(Debug, Clone)]
pub(crate) struct StripResponses {
    /// Strips of the sample mask, and its bars where light leaks through them; one without edges of slits.
    pub(crate) sample: Vec<SampleStrip>,
    /// The same of the detector mask.
    pub(crate) detector: Vec<DetectorStrip>,
    /// Displacement of the sample mask at each mask step, rows downwards.
    steps: Vec<f64>,
    spots: Vec<Spot>,
    /// Displacement of light on the analyser over that on the detector.
    at_analyser: f64,
}

/// Strip of the sample mask.
#[derive(Debug, Clone)]
pub(crate) struct SampleStrip {
    edges: Option<Edges>,
    /// Share of the light that it passes.
    share: f64,
    /// Openings by mask step, from the nearest period of the mask, m in the cell plane.
    pub(crate) openings: Vec<Opening>,
}

/// Strip of the detector mask.
#[derive(Debug, Clone)]
pub(crate) struct DetectorStrip {
    edges: Option<Edges>,
    /// Response along x behind it.
    pub(crate) response: Response,
}

/// Ends of a strip along z, which repeat.
#[derive(Debug, Clone, Copy)]
struct Edges {
    /// Row coordinates.
    ends: [f64; 2],
    /// Rows.
    period: f64,
}

/// Strips of both masks that light passes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StripPair<'a> {
    pub(crate) sample: &'a SampleStrip,
    pub(crate) detector: &'a DetectorStrip,
}

/// Light on its way to the detector.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fall {
    /// Row coordinate where it lands undisplaced.
    pub(crate) row: f64,
    /// Displacement, rows downwards.
    pub(crate) down: f64,
}

/// Displacement of rays by a part of the focal spot, rows downwards.
#[derive(Debug, Clone, Copy)]
struct Shift {
    mean: f64,
    /// Displacement by a standard deviation of the part.
    deviation: f64,
}

/// Part of the focal spot.
#[derive(Debug, Clone, Copy)]
struct Spot {
    /// Share of all light.
    share: f64,
    at_mask: Shift,
    at_analyser: Shift,
    at_detector: Shift,
}

impl SampleStrip {
    /// True if it ends along z.
    pub(crate) fn ends(&self) -> bool {
        self.edges.is_some()
    }
}

impl Shift {
    /// Offsets of the source, standard deviations, that move light at a row coordinate into an interval.
    fn offsets(self, row: f64, ends: [f64; 2]) -> [f64; 2] {
        let [low, high] = ends.map(|end| end - row - self.mean);
        if self.deviation.abs() > 0.0 {
            let [a, b] = [low, high].map(|it| it / self.deviation);
            [a.min(b), a.max(b)]
        } else if low <= 0.0 && high > 0.0 {
            [f64::NEG_INFINITY, f64::INFINITY]
        } else {
            [0.0; 2]
        }
    }

    /// The same for a strip in each period that light of the spot reaches.
    fn offsets_of_strip(self, row: f64, edges: Option<Edges>) -> Vec<[f64; 2]> {
        let Some(Edges { ends: [low, high], period }) = edges else {
            return vec![[f64::NEG_INFINITY, f64::INFINITY]];
        };
        let row = row + self.mean;
        let reach = NO_LIGHT * self.deviation.abs();
        let [first, last] = [(row - reach - high) / period, (row + reach - low) / period];
        let periods = numbers::whole::<i64>(first.ceil())..=numbers::whole::<i64>(last.floor());
        let own = Self { mean: 0.0, ..self };
        let in_period = |number: i64| [low, high].map(|end| end + number as f64 * period);
        periods.map(|number| own.offsets(row, in_period(number))).collect()
    }
}

impl StripResponses {
    /// Responses at a list of mask offsets, from the response of whole rows; nothing of slits. `soft`: distance along x
    /// from which an opening is seen, m. `leaks`: shares of light through bars that count.
    pub(super) fn new(
        optics: &Optics,
        whole: &Response,
        list: usize,
        soft: f64,
        leaks: [f32; 2],
    ) -> Option<Self> {
        if !optics.has_heights() {
            return None;
        }
        let offsets = &optics.offsets.lists()[list];
        let strips = |mask: &Option<Mask>, plane: f64| mask.as_ref()?.strips(plane, STRIPS);
        let of_sample = strips(&optics.sample_mask, optics.cell_plane);
        let of_detector = strips(&optics.detector_mask, optics.analyser);
        let has_edges = of_sample.is_some();
        let sample = match (of_sample, optics.passed()) {
            (Some(strips), Some(passed)) => {
                let strip = |(strip, edges): (&_, Edges)| SampleStrip {
                    edges: Some(edges),
                    share: f64::from(1.0 - leaks[0]),
                    openings: openings_of_steps(&passed.of_strip(strip), offsets, soft),
                };
                let half = single(0.5 * passed.period[0]);
                let open = |step| Opening { step, x: [-half, half] };
                let bars = SampleStrip {
                    edges: None,
                    share: leaks[0].into(),
                    openings: (0..numbers::count(offsets.len())).map(open).collect(),
                };
                let all = edges(optics, &strips, optics.cell_plane).into_iter().map(strip);
                all.chain((leaks[0] > 0.0).then_some(bars)).collect()
            }
            _ => vec![SampleStrip { edges: None, share: 1.0, openings: whole.openings.clone() }],
        };
        let steps = if has_edges { offsets.len() } else { whole.steps() };
        let leak = if has_edges { 0.0 } else { whole.leak };
        let behind = |edges: Option<Edges>, windows: Vec<Windows>| DetectorStrip {
            edges,
            response: whole.with_windows(windows, leak, steps),
        };
        let detector = match of_detector {
            Some(strips) => {
                let apertures = optics.windows();
                let strip = |(strip, edges): (&_, Edges)| {
                    let windows =
                        whole.windows[0].of_strip(&apertures.of_strip(strip), whole.blur.into());
                    behind(Some(edges), vec![windows])
                };
                let bars = whole.windows.last().filter(|_| leaks[1] > 0.0);
                let bars = bars.map(|pixels| behind(None, vec![pixels.with_share(leaks[1])]));
                edges(optics, &strips, optics.analyser).into_iter().map(strip).chain(bars).collect()
            }
            None => vec![behind(None, whole.windows.clone())],
        };
        let down = optics.sample_mask.as_ref().map_or(0.0, |mask| -rows(optics, mask.distance()));
        let lists_z = &optics.offsets.lists_z()[list];
        let at_step = |step: usize| lists_z.get(step).map_or(0.0, |offset| offset * down);
        let axis = optics.analyser - optics.lever_arm;
        let detector_distance = optics.detector.distance;
        Some(Self {
            sample,
            detector,
            steps: (0..steps).map(at_step).collect(),
            spots: spots(optics),
            at_analyser: (optics.analyser - axis) / (detector_distance - axis) * detector_distance
                / optics.analyser,
        })
    }

    /// Farthest that a part of the focal spot takes light on the detector, rows.
    pub(crate) fn reach(&self) -> f64 {
        let of =
            |spot: &Spot| spot.at_detector.mean.abs() + NO_LIGHT * spot.at_detector.deviation.abs();
        self.spots.iter().map(of).fold(0.0, f64::max)
    }

    /// Share of light that passes two strips at a mask step and lands in some rows.
    pub(crate) fn share(
        &self,
        StripPair { sample, detector }: StripPair<'_>,
        step: usize,
        Fall { row, down }: Fall,
        rows: &Range<i64>,
    ) -> f64 {
        let of_spot = |spot: &Spot| {
            let rows = [rows.start as f64, rows.end as f64];
            let lands = spot.at_detector.offsets(row + down, rows);
            let before = spot.at_mask.offsets_of_strip(row - self.steps[step], sample.edges);
            let at_analyser = row + self.at_analyser * down;
            let behind = spot.at_analyser.offsets_of_strip(at_analyser, detector.edges);
            let of_pair = |a: &[f64; 2], b: &[f64; 2]| {
                let low = lands[0].max(a[0]).max(b[0]);
                let high = lands[1].min(a[1]).min(b[1]);
                if high > low { normal_share(high) - normal_share(low) } else { 0.0 }
            };
            let pairs = before.iter().flat_map(|a| behind.iter().map(move |b| of_pair(a, b)));
            spot.share * pairs.sum::<f64>()
        };
        sample.share * self.spots.iter().map(of_spot).sum::<f64>()
    }
}

/// Strips of a mask with their ends in rows.
fn edges<'a>(
    optics: &Optics,
    strips: &'a Strips,
    plane: f64,
) -> Vec<(&'a beamlet_model::scene::Strip, Edges)> {
    let at = |z: f64| optics.detector.row_at(strips.centre + z, plane);
    let period = at(0.0) - at(strips.period);
    let of = |strip: &'a beamlet_model::scene::Strip| {
        (strip, Edges { ends: [at(strip.z[1]), at(strip.z[0])], period })
    };
    strips.strips.iter().map(of).collect()
}

/// Rows downwards by which light that is moved by 1 m along z in a plane lands aside.
fn rows(optics: &Optics, plane: f64) -> f64 {
    optics.detector.row_at(0.0, plane) - optics.detector.row_at(1.0, plane)
}

fn spots(optics: &Optics) -> Vec<Spot> {
    let at = |plane: f64| rows(optics, plane) * (plane / optics.rotation - 1.0);
    let spot = |part: &beamlet_model::spot::PlacedPart| {
        let shift = |scale: f64| Shift {
            mean: scale * part.offset[1],
            deviation: scale * part.deviation[1],
        };
        Spot {
            share: part.share,
            at_mask: shift(at(optics.cell_plane)),
            at_analyser: shift(at(optics.analyser)),
            at_detector: shift(at(optics.detector.distance)),
        }
    };
    optics.spot.placed().iter().map(spot).collect()
}
