//! Curves of pixels over mask steps along x and z.

use super::super::background::Background;
use super::super::curve_model::{CurveModel, NEEDED};
use super::super::curves::Curve;
use super::super::method::Method;
use super::super::model::Model;
use super::super::options::RetrieveOptions;
use super::super::profile::Profile;
use super::super::scan::along;
use super::super::strips::Strips;
use super::super::value_noise::ValueNoise;
use super::lattice::Lattice;
use super::{geometry, offsets};
use beamlet_core::Result;
use beamlet_core::cancel::Cancel;
use beamlet_core::numbers::whole;
use beamlet_model::optics::{FrontView, Mask, Optics, WholePeriods, ends};
use beamlet_model::scene::{ApertureLattice, Scene};
use ndarray::ArrayView3;
use rayon::prelude::*;

/// A curve is seen this many standard deviations of its blur beyond its ends.
const SEEN: f64 = 4.0;

/// A curve in each pixel.
#[derive(Debug)]
pub(crate) struct StepCurves {
    pub(in crate::retrieve) model: CurveModel,
    /// Centres of the curves of a list of apertures; `None` of curves with one peak.
    centres: Option<Centres>,
    /// The curve of the masks, where the scene knows it and it has one peak.
    pub(in crate::retrieve) truth: Option<CurveModel>,
    /// Offsets along z with whole periods, m.
    pub(in crate::retrieve) offsets_z: Vec<f64>,
}

impl StepCurves {
    /// The model of curves over these offsets, m, and the offsets without whole periods of the sample mask.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Scene`] for offsets that do not determine a curve; [`beamlet_core::Error::Argument`] for a
    /// mask whose apertures are not known.
    pub(crate) fn of(
        scene: &Scene,
        options: &RetrieveOptions,
        pairs: &[[f64; 2]],
    ) -> Result<(Self, Vec<[f64; 2]>)> {
        offsets::check(pairs, NEEDED)?;
        let offsets = without_periods(scene, pairs);
        let model = curve_model(scene, options, &offsets)?;
        let centres = Centres::of(scene, &offsets);
        let truth = match centres {
            Some(_) => None,
            None => known_curve(scene, options, &offsets)?,
        };
        let offsets_z = along(pairs, 1);
        Ok((Self { model, centres, truth, offsets_z }, offsets))
    }

    /// Offsets of a view with steps at these places along x, less the whole periods of the sample mask that place them
    /// nearest to the flat's. `flat`: offsets of the flat with and without whole periods.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Scene`] for offsets that do not determine a curve.
    pub(crate) fn offsets_of_view(
        scene: &Scene,
        x: &[f64],
        flat: [&[[f64; 2]]; 2],
    ) -> Result<Vec<[f64; 2]>> {
        let offsets = of_view(scene, x, flat);
        offsets::check(&offsets, NEEDED)?;
        Ok(offsets)
    }

    /// True for curves of a list of apertures, whose place depends on the pixel.
    pub(crate) const fn is_of_list(&self) -> bool {
        self.centres.is_some()
    }

    /// The curve of the masks with the background of the fits, or the model of the fits where the scene does not know it.
    pub(in crate::retrieve) fn of_masks(&self) -> CurveModel {
        let truth = self.truth.as_ref().unwrap_or(&self.model);
        CurveModel { background: self.model.background, ..truth.clone() }
    }

    /// Fits frames `[step][row][column]` of rows from row `first` on. `flat`: curves of the same pixels of the flat,
    /// `None` for the flat itself.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Interrupted`].
    pub(crate) fn fits(
        &self,
        (frames, first): (ArrayView3<'_, f32>, usize),
        (offsets, noise): (&[[f64; 2]], ValueNoise),
        flat: Option<&[Option<Curve>]>,
        cancel: &Cancel,
    ) -> Result<Vec<Option<Curve>>> {
        let (steps, rows, columns) = frames.dim();
        let scan = self.model.scan(offsets.to_vec(), noise);
        let fit = |at: usize| {
            cancel.check()?;
            let (row, column) = (at / columns, at % columns);
            let curve = (0..steps).map(|step| frames[[step, row, column]]);
            let centre = self.centres.map(|centres| centres.at(first + row, column));
            let of_flat = flat.and_then(|flat| flat[at].as_ref());
            Ok(Some(self.model.fit(&scan, curve, of_flat, centre)))
        };
        (0..rows * columns).into_par_iter().map(fit).collect()
    }
}

/// Offsets less whole periods of the sample mask.
fn without_periods(scene: &Scene, pairs: &[[f64; 2]]) -> Vec<[f64; 2]> {
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

/// Offsets of a view whose steps have these along x, less the whole periods that place it nearest to the flat's: the flat
/// has the offsets `pairs`, and `offsets` without whole periods.
fn of_view(scene: &Scene, x: &[f64], [pairs, offsets]: [&[[f64; 2]]; 2]) -> Vec<[f64; 2]> {
    let (flat, [period, _]) = (along(pairs, 0), periods(scene));
    let x = match period.is_finite() {
        true => WholePeriods::in_scan(&flat, period).nearest_to(&flat, x).without(x),
        false => x.to_vec(),
    };
    x.iter().zip(offsets).map(|(x, [_, z])| [*x, *z]).collect()
}

/// Periods of the sample mask along x and z, m in its plane.
fn periods(scene: &Scene) -> [f64; 2] {
    let optics = Optics::of(scene);
    let of = |mask: &Mask| mask.openings(mask.distance()).period;
    optics.sample_mask.as_ref().map_or([f64::INFINITY; 2], of)
}

/// Model of the curve of a sample mask over offsets without whole periods, before a detector mask or pixels.
fn curve_model(
    scene: &Scene,
    options: &RetrieveOptions,
    offsets: &[[f64; 2]],
) -> Result<CurveModel> {
    let background = options.background().term(scene, area_of_curve(scene))?;
    if options.method() == Method::Gaussian {
        let model = Model::Strips(Strips::one([Profile::GAUSSIAN; 2], Vec::new()));
        return Ok(CurveModel { model, background, blur: None, pixel: None, is_planar: true });
    }
    let is_list = geometry::list(scene).is_some();
    let count = if is_list { seen_periods(scene, offsets) } else { [1; 2] };
    let neighbours = neighbours(scene, count)?;
    let strips = Strips { strips: geometry::overlap(scene, options)?, neighbours, is_list };
    let blur = Some(geometry::blur(scene, true));
    let model = Model::Strips(strips);
    Ok(CurveModel { model, background, blur, pixel: None, is_planar: true })
}

/// The curve of the masks over offsets without whole periods, with the light that they leak; `None` where the scene does
/// not know it.
///
/// # Errors
/// Errors of the materials of the masks and of the beam.
fn known_curve(
    scene: &Scene,
    options: &RetrieveOptions,
    offsets: &[[f64; 2]],
) -> Result<Option<CurveModel>> {
    let exact = options.clone().with_method(Method::ExactCurve).with_background(Background::Leak);
    let is_known = geometry::knows_curve(scene, &exact);
    is_known.then(|| curve_model(scene, &exact, offsets)).transpose()
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
    fn of(scene: &Scene, offsets: &[[f64; 2]]) -> Option<Self> {
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
    fn at(&self, row: usize, column: usize) -> [f64; 2] {
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
