//! Beamlets on a lattice that is found in a flat.

use super::super::background_term::BackgroundTerm;
use super::super::curve_model::CurveModel;
use super::super::curves::Curve;
use super::super::method::Method;
use super::super::model::Model;
use super::super::moments::{self, by_moments};
use super::super::options::RetrieveOptions;
use super::super::profile::Profile;
use super::super::scan::Scan;
use super::super::strips::{Strips, own_variances};
use super::super::value_noise::ValueNoise;
use super::aperture::Aperture;
use super::found::{Frame, PlacedLattice};
use super::geometry;
use super::lattice::Lattice;
use super::windows::{Window, Windows};
use beamlet_core::cancel::Cancel;
use beamlet_core::{Error, Result};
use beamlet_model::scene::Scene;
use ndarray::{Array2, ArrayView3, Axis};
use rayon::prelude::*;
use std::ops::Range;

/// Beamlets of the flat, about, whose centres give the lattice.
const CENTRES: usize = 400;

/// Set-up of beamlets on a lattice.
#[derive(Debug, Clone)]
pub(crate) struct LatticeDesign {
    /// The lattice by the options or the scene.
    lattice: Lattice,
    /// Aperture of the sample mask as it is projected on the detector.
    aperture: Option<Aperture>,
    /// Variances xx and zz of the blur of spot and detector, m^2 on the detector.
    blur: [f64; 2],
    /// Size of a pixel, m.
    pitch: [f64; 2],
    options: RetrieveOptions,
}

/// Beamlets of a frame.
#[derive(Debug)]
pub(crate) struct LatticeBeamlets {
    pub(in crate::retrieve) model: CurveModel,
    method: Method,
    frame: Frame,
    placed: PlacedLattice,
    windows: Windows,
}

impl LatticeDesign {
    /// The set-up of a scene.
    pub(crate) fn of(scene: &Scene, options: &RetrieveOptions, lattice: Lattice) -> Self {
        Self {
            lattice,
            aperture: geometry::aperture(scene, options),
            blur: geometry::blur(scene, false),
            pitch: scene.detector.pitch,
            options: options.clone(),
        }
    }

    /// The beamlets of a flat `[0][row][column]`.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Argument`] where the flat does not have the lattice, or an option is missing.
    pub(crate) fn find(&self, flat: ArrayView3<'_, f32>) -> Result<LatticeBeamlets> {
        let (_, rows, columns) = flat.dim();
        let frame = Frame { shape: [rows, columns], pitch: self.pitch };
        // Saturated values say nothing of the lattice.
        let limit = self.options.saturation.unwrap_or(f32::INFINITY);
        let known = |value: &f32| if *value < limit { *value } else { f32::NAN };
        let first = flat.index_axis(Axis(0), 0).map(known);
        let placed = match PlacedLattice::find(first.view(), &frame, self.lattice) {
            // A few periods do not give the vectors; those of a scene are known.
            Err(_) if self.options.lattice.is_none() => {
                PlacedLattice::place(first.view(), &frame, self.lattice)?
            }
            found => found?,
        };
        let placed = through_centres(placed, &frame, (&self.options, flat))?;
        let windows = Windows::of(&placed, &frame)?;
        let model = beamlet_model(self, &placed)?;
        Ok(LatticeBeamlets { model, method: self.options.method(), frame, placed, windows })
    }
}

impl LatticeBeamlets {
    /// Rows and columns of the images.
    pub(crate) const fn shape(&self) -> [usize; 2] {
        self.windows.shape
    }

    /// Rows and columns of the frames.
    pub(crate) const fn frame(&self) -> [usize; 2] {
        self.frame.shape
    }

    /// Vectors of the lattice, and the place of one of its beamlets from the middle of the frame, m.
    pub(crate) const fn vectors(&self) -> [[f64; 2]; 3] {
        let [a, b] = self.placed.lattice.vectors;
        [a, b, self.placed.origin]
    }

    /// Places of the columns of the images, m.
    pub(crate) fn columns_m(&self) -> Vec<f64> {
        self.windows.columns()
    }

    /// Places of the beamlets in the images from the middle of the frame, m; NaN where there is none.
    pub(crate) fn places(&self) -> Array2<[f64; 2]> {
        let mut places = Array2::from_elem(self.windows.shape, [f64::NAN; 2]);
        let columns = self.windows.shape[1];
        for (at, window) in self.windows.iter() {
            places[[at / columns, at % columns]] = window.centre;
        }
        places
    }

    /// Fits a frame `[0][row][column]`. `flat`: curves of the same beamlets of the flat, `None` for the flat itself.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Interrupted`].
    pub(crate) fn fits(
        &self,
        frame: ArrayView3<'_, f32>,
        noise: ValueNoise,
        flat: Option<&[Option<Curve>]>,
        cancel: &Cancel,
    ) -> Result<Vec<Option<Curve>>> {
        let all: Vec<(usize, &Window)> = self.windows.iter().collect();
        let fit = |(at, window): &(usize, &Window)| -> Result<Curve> {
            cancel.check()?;
            let of_flat = flat.and_then(|flat| flat[*at].as_ref());
            Ok(self.beamlet(frame, window, noise, of_flat))
        };
        let fitted: Vec<Curve> = all.par_iter().map(fit).collect::<Result<_>>()?;
        let mut fits = vec![None; self.windows.count()];
        all.iter().zip(fitted).for_each(|((at, _), curve)| fits[*at] = Some(curve));
        Ok(fits)
    }

    /// The fit, or the moments, of a beamlet.
    fn beamlet(
        &self,
        frame: ArrayView3<'_, f32>,
        window: &Window,
        noise: ValueNoise,
        flat: Option<&Curve>,
    ) -> Curve {
        let scan = window_scan(&self.model, &self.frame, window, noise);
        let curve = values(frame, window);
        if self.method != Method::Moments {
            return self.model.fit(&scan, curve, flat, None);
        }
        let area = self.frame.pitch[0] * self.frame.pitch[1];
        by_moments(&scan, curve, Some(moments::Window { model: &self.model.model, area }))
    }

    /// Rows and columns of the images, a rectangle for each beamlet, whose pixels are all in these rows and columns.
    pub(crate) fn within(&self, [rows, columns]: &[Range<usize>; 2]) -> Vec<[Range<usize>; 2]> {
        let across = self.windows.shape[1];
        let is_within = |[row, column]: &[u32; 2]| {
            rows.contains(&(*row as usize)) && columns.contains(&(*column as usize))
        };
        let all = self.windows.iter().filter(|(_, window)| window.pixels.iter().all(is_within));
        all.map(|(at, _)| [at / across, at % across].map(|at| at..at + 1)).collect()
    }

    /// Beamlets that have a chosen pixel, `[row][column]` of the frame.
    pub(crate) fn touched(&self, pixels: &Array2<bool>) -> Array2<bool> {
        let mut beamlets = Array2::from_elem(self.windows.shape, false);
        let columns = self.windows.shape[1];
        for (at, window) in self.windows.iter() {
            let is_chosen = |[row, column]: &[u32; 2]| pixels[[*row as usize, *column as usize]];
            beamlets[[at / columns, at % columns]] = window.pixels.iter().any(is_chosen);
        }
        beamlets
    }
}

/// The lattice through the centres of some of the flat's beamlets.
fn through_centres(
    placed: PlacedLattice,
    frame: &Frame,
    (options, flat): (&RetrieveOptions, ArrayView3<'_, f32>),
) -> Result<PlacedLattice> {
    let windows = Windows::of(&placed, frame)?;
    let model = gaussian(frame.pitch, Vec::new());
    let saturation = options.saturation.map_or(f64::INFINITY, f64::from);
    let noise = ValueNoise { saturation, ..ValueNoise::default() };
    let all: Vec<&Window> = windows.iter().map(|(_, window)| window).collect();
    let some: Vec<&Window> = all.iter().copied().step_by(1 + all.len() / CENTRES).collect();
    let centres: Vec<([i64; 2], [f64; 2])> = some
        .par_iter()
        .filter_map(|window| {
            let scan = window_scan(&model, frame, window, noise);
            let fit = model.fit(&scan, values(flat, window), None, None);
            let is_fine = fit.has_answer() && fit.uncentred == [false; 2];
            is_fine.then_some((window.index, fit.centre))
        })
        .collect();
    Ok(placed.through(&centres).unwrap_or(placed))
}

/// Places of a beamlet's pixels.
fn window_scan(model: &CurveModel, frame: &Frame, window: &Window, noise: ValueNoise) -> Scan {
    let place = |[row, column]: &[u32; 2]| frame.place(i64::from(*row), i64::from(*column));
    model.scan(window.pixels.iter().map(place).collect(), noise)
}

/// Values of a beamlet's pixels.
fn values<'a>(frames: ArrayView3<'a, f32>, window: &'a Window) -> impl Iterator<Item = f32> + 'a {
    let value = move |[row, column]: &[u32; 2]| frames[[0, *row as usize, *column as usize]];
    window.pixels.iter().map(value)
}

/// A Gaussian over pixels.
fn gaussian(pixel: [f64; 2], neighbours: Vec<[f64; 2]>) -> CurveModel {
    let along = pixel.map(|pixel| Profile { boxes: [pixel, 0.0], shift: 0.0 });
    CurveModel {
        model: Model::Strips(Strips::one(along, neighbours)),
        background: BackgroundTerm::Free,
        blur: None,
        pixel: Some(pixel),
        is_planar: true,
    }
}

/// Model of beamlets over pixels.
fn beamlet_model(design: &LatticeDesign, placed: &PlacedLattice) -> Result<CurveModel> {
    let LatticeDesign { aperture, blur, pitch: pixel, ref options, .. } = *design;
    let around = placed.lattice.around();
    if options.method() != Method::Beamlet {
        let own = aperture.map(|aperture| own_variances(&aperture.strips([0.0; 2])));
        let blur = own.map(|own| [0, 1].map(|axis| own[axis] + blur[axis]));
        return Ok(CurveModel { blur, ..gaussian(pixel, around) });
    }
    let Some(aperture) = aperture else {
        let allowed = "the size of the apertures for method beamlet; or method gaussian or moments";
        return Err(Error::argument("aperture", "nothing", allowed));
    };
    let strips = Strips { strips: aperture.strips(pixel), neighbours: around, is_list: false };
    Ok(CurveModel { model: Model::Strips(strips), blur: Some(blur), ..gaussian(pixel, Vec::new()) })
}
