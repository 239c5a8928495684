//! Models of beamlets and of curves over offsets, and the lattice and the offsets that they need.

use super::super::background_term::BackgroundTerm;
use super::super::fitter::Weights;
use super::super::method::Method;
use super::super::model::Model;
use super::super::options::RetrieveOptions;
use super::super::profile::Profile;
use super::super::scan::Scan;
use super::super::strips::{Strips, own_variances};
use super::super::value_noise::ValueNoise;
use super::fit::PlanarModel;
use super::found::{Frame, PlacedLattice};
use super::geometry;
use super::lattice::Lattice;
use super::windows::{Window, Windows};
use beamlet_core::numbers::whole;
use beamlet_core::{Error, Result};
use beamlet_model::optics::{FrontView, Mask, Optics, WholePeriods, ends};
use beamlet_model::scene::{ApertureLattice, Scene};
use ndarray::ArrayView3;
use rayon::prelude::*;

/// Beamlets of the flat, about, whose centres give the lattice.
const CENTRES: usize = 400;
/// A curve is seen this many standard deviations of its blur beyond its ends.
const SEEN: f64 = 4.0;

/// The lattice through the centres of some of the flat's beamlets.
pub(super) fn through_centres(
    placed: PlacedLattice,
    frame: &Frame,
    (options, flat): (&RetrieveOptions, ArrayView3<'_, f32>),
) -> Result<PlacedLattice> {
    let windows = Windows::of(&placed, frame)?;
    let model = gaussian(frame.pitch, Vec::new());
    let noise = ValueNoise {
        saturation: options.saturation.map_or(f64::INFINITY, f64::from),
        gain: None,
        read_noise: 0.0,
        weights: Weights::None,
    };
    let all: Vec<&Window> = windows.iter().map(|(_, window)| window).collect();
    let some: Vec<&Window> = all.iter().copied().step_by(1 + all.len() / CENTRES).collect();
    let centres: Vec<([i64; 2], [f64; 2])> = some
        .par_iter()
        .filter_map(|window| {
            let scan = window_scan(&model, frame, window, noise);
            let fit = model.fit(&scan, values(flat, window), None, None);
            let is_fine =
                fit.curve.has_answer() && fit.curve.centre.iter().all(|at| at.is_finite());
            is_fine.then_some((window.index, fit.curve.centre))
        })
        .collect();
    Ok(placed.through(&centres).unwrap_or(placed))
}

/// Places of a beamlet's pixels.
pub(super) fn window_scan(
    model: &PlanarModel,
    frame: &Frame,
    window: &Window,
    noise: ValueNoise,
) -> Scan {
    let place = |[row, column]: &[u32; 2]| frame.place(i64::from(*row), i64::from(*column));
    model.scan(window.pixels.iter().map(place).collect(), noise)
}

/// Values of a beamlet's pixels.
pub(super) fn values<'a>(
    frames: ArrayView3<'a, f32>,
    window: &'a Window,
) -> impl Iterator<Item = f32> + 'a {
    let value = move |[row, column]: &[u32; 2]| frames[[0, *row as usize, *column as usize]];
    window.pixels.iter().map(value)
}

/// A Gaussian over pixels.
fn gaussian(pixel: [f64; 2], neighbours: Vec<[f64; 2]>) -> PlanarModel {
    let along = pixel.map(|pixel| Profile { boxes: [pixel, 0.0], shift: 0.0 });
    PlanarModel {
        model: Model::Strips(Strips::one(along, neighbours)),
        blur: None,
        pixel: Some(pixel),
        background: BackgroundTerm::Free,
    }
}

/// Offsets less whole periods of the sample mask.
pub(super) fn without_periods(scene: &Scene, pairs: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let period = periods(scene);
    let kept = [0, 1].map(|axis| {
        let all = along(pairs, axis);
        match period[axis].is_finite() {
            true => WholePeriods::in_scan(&all, period[axis]).without(&all),
            false => all,
        }
    });
    kept[0].iter().zip(&kept[1]).map(|(x, z)| [*x, *z]).collect()
}

/// Periods of the sample mask along x and z, m in its plane.
fn periods(scene: &Scene) -> [f64; 2] {
    let optics = Optics::of(scene);
    let of = |mask: &Mask| mask.openings(mask.distance()).period;
    optics.sample_mask.as_ref().map_or([f64::INFINITY; 2], of)
}

/// Model of beamlets over pixels.
pub(super) fn beamlet_model(
    scene: &Scene,
    options: &RetrieveOptions,
    (placed, pixel): (&PlacedLattice, [f64; 2]),
) -> Result<PlanarModel> {
    let aperture = geometry::aperture(scene, options);
    let blur = geometry::blur(scene, false);
    let around = placed.lattice.around();
    if options.method() != Method::Beamlet {
        let own = aperture.map(|aperture| own_variances(&aperture.strips([0.0; 2])));
        let blur = own.map(|own| [0, 1].map(|axis| own[axis] + blur[axis]));
        return Ok(PlanarModel { blur, ..gaussian(pixel, around) });
    }
    let Some(aperture) = aperture else {
        let allowed = "the size of the apertures for method beamlet; or method gaussian or moments";
        return Err(Error::argument("aperture", "nothing", allowed));
    };
    let strips = Strips { strips: aperture.strips(pixel), neighbours: around, is_list: false };
    Ok(PlanarModel {
        model: Model::Strips(strips),
        blur: Some(blur),
        pixel: Some(pixel),
        background: BackgroundTerm::Free,
    })
}

/// Model of the curve of a sample mask over offsets without whole periods, before a detector mask or pixels.
pub(super) fn curve_model(
    scene: &Scene,
    options: &RetrieveOptions,
    offsets: &[[f64; 2]],
) -> Result<PlanarModel> {
    let background = options.background().term(scene, area_of_curve(scene))?;
    if options.method() == Method::Gaussian {
        let model = Model::Strips(Strips::one([Profile::GAUSSIAN; 2], Vec::new()));
        return Ok(PlanarModel { model, blur: None, pixel: None, background });
    }
    let is_list = geometry::list(scene).is_some();
    let count = if is_list { seen_periods(scene, offsets) } else { [1; 2] };
    let neighbours = neighbours(scene, count)?;
    let strips = Strips { strips: geometry::overlap(scene, options)?, neighbours, is_list };
    let blur = Some(geometry::blur(scene, true));
    Ok(PlanarModel { model: Model::Strips(strips), blur, pixel: None, background })
}

/// Area of the lattice of curves for each aperture, or for a period of a list, m2 in the plane of the sample mask.
fn area_of_curve(scene: &Scene) -> f64 {
    let [x, z] = periods(scene);
    let lattice = scene.sample_mask.as_ref().map(|mask| mask.lattice);
    // A period along z has two rows.
    if lattice == Some(ApertureLattice::Hexagonal) { 0.5 * x * z } else { x * z }
}

/// Periods of a list on either side of one about the middle of a scan that pixels see at its offsets.
fn seen_periods(scene: &Scene, offsets: &[[f64; 2]]) -> [u32; 2] {
    let blur = geometry::blur(scene, true);
    let period = periods(scene);
    [0, 1].map(|axis| {
        let pixel = scene.detector.pitch[axis] / scene.magnification();
        let [low, high] = ends(&along(offsets, axis));
        // The centre of the period is within half of one from the middle.
        let reach = 0.5 * (high - low + period[axis] + pixel) + SEEN * blur[axis].sqrt();
        let beyond = (reach - 0.5 * period[axis]) / period[axis];
        if beyond.is_finite() { whole::<u32>(beyond.ceil()).max(1) } else { 1 }
    })
}

/// Offsets along an axis, m.
fn along(offsets: &[[f64; 2]], axis: usize) -> Vec<f64> {
    offsets.iter().map(|pair| pair[axis]).collect()
}

/// Places of the curves of neighbouring apertures, or of this number of periods of a list on either side, m in the
/// plane of the sample mask.
fn neighbours(scene: &Scene, count: [u32; 2]) -> Result<Vec<[f64; 2]>> {
    let period = periods(scene);
    let lattice = scene.sample_mask.as_ref().map(|mask| mask.lattice);
    if lattice == Some(ApertureLattice::Hexagonal) {
        // A period along z has two rows.
        let [x, z] = period;
        return Ok(Lattice::new([[x, 0.0], [0.5 * x, 0.5 * z]])?.around());
    }
    let steps = [0, 1].map(|axis| {
        let count = if period[axis].is_finite() { i64::from(count[axis]) } else { 0 };
        (-count..=count).map(|k| k as f64 * period[axis]).collect::<Vec<_>>()
    });
    let all = steps[0].iter().flat_map(|x| steps[1].iter().map(move |z| [*x, *z]));
    Ok(all.filter(|[x, z]| x.abs() + z.abs() > 0.0).collect())
}

/// Centre of the curve of each pixel of a list of apertures.
#[derive(Debug, Clone, Copy)]
pub(super) struct Centres {
    /// Centre of a period of the list, m in the plane of the sample mask.
    origin: [f64; 2],
    period: [f64; 2],
    /// Columns and rows of pixels.
    pixels: [u32; 2],
    /// Size of a pixel in the plane of the sample mask, m.
    pixel: [f64; 2],
    /// Middle of the scan, m.
    middle: [f64; 2],
}

impl Centres {
    /// Centres for the list of a scene that is scanned at these offsets; `None` without a list.
    pub(super) fn of(scene: &Scene, offsets: &[[f64; 2]]) -> Option<Self> {
        let mask = geometry::list(scene)?;
        let view = FrontView::of(mask, scene.detector.pixels, 1)?;
        Some(Self {
            origin: [view.centre, view.strips.centre],
            period: [view.period, view.strips.period],
            pixels: scene.detector.pixels,
            pixel: scene
                .detector
                .pitch
                .map(|pitch| pitch * mask.distance / scene.detector.distance),
            middle: [0, 1].map(|axis| {
                let [low, high] = ends(&along(offsets, axis));
                f64::midpoint(low, high)
            }),
        })
    }

    /// The mask offset, nearest to the middle of the scan, at which a centre of a period lies before a pixel, m.
    pub(super) fn at(&self, row: usize, column: usize) -> [f64; 2] {
        let from_middle = |index: usize, count: u32| index as f64 + 0.5 - 0.5 * f64::from(count);
        let [columns, rows] = self.pixels;
        // Rows run down, z up.
        let place = [from_middle(column, columns), -from_middle(row, rows)];
        [0, 1].map(|axis| {
            let offset = place[axis] * self.pixel[axis] - self.origin[axis];
            let whole = ((offset - self.middle[axis]) / self.period[axis]).round();
            offset - self.period[axis] * whole
        })
    }
}
