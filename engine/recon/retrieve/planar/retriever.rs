//! A design made ready for frames of a shape: the flat's curves once, then the images of each view.

use super::super::flags;
use super::super::images::{self, CONTRASTS, FLAGS, Images};
use super::super::method::Method;
use super::super::misfit;
use super::super::noise_factors::NoiseFactors;
use super::super::options::RetrieveOptions;
use super::super::value_noise::ValueNoise;
use super::fit::{NEEDED, PlanarFit, PlanarModel};
use super::found::{Frame, PlacedLattice};
use super::geometry::Design;
use super::models::{
    Centres, beamlet_model, curve_model, through_centres, values, window_scan, without_periods,
};
use super::moments::by_moments;
use super::offsets;
use super::windows::{Window, Windows};
use beamlet_core::cancel::Cancel;
use beamlet_core::{Error, Result, numbers};
use beamlet_model::scene::Scene;
use ndarray::{Array2, ArrayView3, Axis};
use rayon::prelude::*;

/// Fits by their place in the images; `None` where there is no beamlet.
pub(crate) type Fits = Vec<Option<PlanarFit>>;

/// Curves of a design.
#[derive(Debug)]
enum Curves {
    /// Beamlets in their windows, and the lattice that was found in the flat.
    Beamlets(Windows, PlacedLattice),
    /// A curve in each pixel, over these offsets without whole periods of the sample mask, m; for a list the centres
    /// of the curves.
    Pixels(Vec<[f64; 2]>, Option<Centres>),
}

/// A design made ready for frames.
#[derive(Debug)]
pub(crate) struct PlanarRetriever {
    options: RetrieveOptions,
    frame: Frame,
    curves: Curves,
    model: PlanarModel,
    /// Refraction angle per shift of a centre.
    angle_per_shift: f64,
    /// Whole periods along x that the scan has more than these offsets, m.
    whole_periods: f64,
}

impl PlanarRetriever {
    /// Makes a design ready. `flat`: a frame of the flat, in which a lattice is found.
    ///
    /// # Errors
    /// [`Error::Argument`] where the flat does not have the lattice, or an option is missing; [`Error::Scene`]
    /// for offsets that do not determine a curve.
    pub(crate) fn new(
        (scene, design): (&Scene, &Design),
        options: &RetrieveOptions,
        pitch: [f64; 2],
        flat: ArrayView3<'_, f32>,
    ) -> Result<Self> {
        let (_, rows, columns) = flat.dim();
        let frame = Frame { shape: [rows, columns], pitch };
        let lever = scene.lever_arm();
        let mut whole_periods = 0.0;
        let (curves, model, angle_per_shift) = match design {
            Design::Beamlets(given) => {
                // Saturated values say nothing of the lattice.
                let limit = options.saturation.unwrap_or(f32::INFINITY);
                let known = |value: &f32| if *value < limit { *value } else { f32::NAN };
                let first = flat.index_axis(Axis(0), 0).map(known);
                let placed = match PlacedLattice::find(first.view(), &frame, *given) {
                    // A few periods do not give the vectors; those of a scene are known.
                    Err(_) if options.lattice.is_none() => {
                        PlacedLattice::place(first.view(), &frame, *given)?
                    }
                    found => found?,
                };
                let placed = through_centres(placed, &frame, (options, flat))?;
                let windows = Windows::of(&placed, &frame)?;
                let model = beamlet_model(scene, options, (&placed, pitch))?;
                (Curves::Beamlets(windows, placed), model, 1.0 / lever)
            }
            Design::Steps(pairs) => {
                offsets::check(pairs, NEEDED)?;
                let kept = without_periods(scene, pairs);
                whole_periods =
                    pairs.first().zip(kept.first()).map_or(0.0, |(all, own)| all[0] - own[0]);
                let model = curve_model(scene, options, &kept)?;
                let centres = Centres::of(scene, &kept);
                (Curves::Pixels(kept, centres), model, -scene.magnification() / lever)
            }
        };
        Ok(Self { options: options.clone(), frame, curves, model, angle_per_shift, whole_periods })
    }

    /// Refraction angle per shift of a centre, rad/m.
    pub(crate) const fn angle_per_shift(&self) -> f64 {
        self.angle_per_shift
    }

    /// The options.
    pub(super) const fn options(&self) -> &RetrieveOptions {
        &self.options
    }

    /// The model of the curves.
    pub(super) const fn model(&self) -> &PlanarModel {
        &self.model
    }

    /// Offsets of curves with one peak, without whole periods, m; `None` of beamlets and lists.
    pub(super) fn pairs(&self) -> Option<&[[f64; 2]]> {
        match &self.curves {
            Curves::Pixels(pairs, None) => Some(pairs),
            _ => None,
        }
    }

    /// Whole periods of the sample mask along x, m, that offsets of the scan have more than centres of curves.
    pub(crate) const fn whole_periods(&self) -> f64 {
        self.whole_periods
    }

    /// Rows and columns of the images, of frames of `rows` rows.
    pub(crate) fn shape(&self, rows: usize) -> [usize; 2] {
        match &self.curves {
            Curves::Beamlets(windows, _) => windows.shape,
            Curves::Pixels(..) => [rows, self.frame.shape[1]],
        }
    }

    /// True if all rows of a frame are needed together.
    pub(crate) const fn needs_whole_frames(&self) -> bool {
        matches!(self.curves, Curves::Beamlets(..))
    }

    /// Vectors of the lattice that was found, and the place of one of its beamlets from the middle of the frame, m.
    pub(crate) fn lattice(&self) -> Option<[[f64; 2]; 3]> {
        match &self.curves {
            Curves::Beamlets(_, placed) => {
                let [a, b] = placed.lattice.vectors;
                Some([a, b, placed.origin])
            }
            Curves::Pixels(..) => None,
        }
    }

    /// Places of the columns of beamlets, m; `None` for pixels.
    pub(crate) fn columns_m(&self) -> Option<Vec<f64>> {
        match &self.curves {
            Curves::Beamlets(windows, _) => Some(windows.columns()),
            Curves::Pixels(..) => None,
        }
    }

    /// Fits frames `[step][row][column]`, all rows of beamlets or rows of pixels from row `first` on. `flat`: fits of
    /// the same curves of the flat, `None` for the flat itself.
    ///
    /// # Errors
    /// [`Error::Scene`] for another number of frames than of offsets; [`Error::Interrupted`].
    pub(crate) fn fits(
        &self,
        (frames, first): (ArrayView3<'_, f32>, usize),
        factors: NoiseFactors,
        flat: Option<&[Option<PlanarFit>]>,
        cancel: &Cancel,
    ) -> Result<Fits> {
        let noise = ValueNoise::of(&self.options, factors);
        let (steps, rows, columns) = frames.dim();
        let of_flat = |at: usize| flat.and_then(|flat| flat.get(at)?.as_ref());
        match &self.curves {
            Curves::Beamlets(windows, _) => {
                let all: Vec<(usize, &Window)> = windows.iter().collect();
                let fit = |(at, window): &(usize, &Window)| -> Result<(usize, PlanarFit)> {
                    cancel.check()?;
                    Ok((*at, self.beamlet(frames, window, noise, of_flat(*at))))
                };
                let fitted: Vec<_> = all.par_iter().map(fit).collect::<Result<_>>()?;
                let mut fits = vec![None; windows.count()];
                for (at, fit) in fitted {
                    fits[at] = Some(fit);
                }
                Ok(fits)
            }
            Curves::Pixels(pairs, centres) => {
                if steps != pairs.len() {
                    let found = format!("{} offsets for {steps} frames", pairs.len());
                    let allowed = "one offset for each frame";
                    return Err(Error::scene("scan.mask_offsets", found, allowed));
                }
                let scan = self.model.scan(pairs.clone(), noise);
                let fit = |at: usize| {
                    cancel.check()?;
                    let (row, column) = (at / columns, at % columns);
                    let curve = (0..steps).map(|step| frames[[step, row, column]]);
                    let centre = centres.map(|centres| centres.at(first + row, column));
                    Ok(Some(self.model.fit(&scan, curve, of_flat(at), centre)))
                };
                (0..rows * columns).into_par_iter().map(fit).collect()
            }
        }
    }

    /// The fit, or the moments, of a beamlet of a frame.
    fn beamlet(
        &self,
        frames: ArrayView3<'_, f32>,
        window: &Window,
        noise: ValueNoise,
        flat: Option<&PlanarFit>,
    ) -> PlanarFit {
        let scan = window_scan(&self.model, &self.frame, window, noise);
        let curve = values(frames, window);
        if self.options.method() != Method::Moments {
            return self.model.fit(&scan, curve, flat, None);
        }
        let area = self.frame.pitch[0] * self.frame.pitch[1];
        PlanarFit::of(by_moments(&scan, curve, &self.model.model, area))
    }

    /// Names of the images of the flat and of a view.
    pub(crate) fn names(&self) -> [Vec<&'static str>; 2] {
        let has_sigmas = self.options.gain.is_some();
        let of_flat = |name: &str| name.starts_with("flat_");
        images::names(|name| !name.ends_with("_sigma") || (has_sigmas && !of_flat(name)))
    }

    /// Images of the flat from its fits.
    pub(crate) fn images_of_flat(&self, flat: &[Option<PlanarFit>], rows: usize) -> Images {
        let [height, width] = self.shape(rows);
        let [names, _] = self.names();
        let mut images = Images::new(names, height, width);
        images.take_flat(|at| Some(flat.get(at)?.as_ref()?.curve));
        images
    }

    /// Images of a view from the fits of flat and sample.
    pub(crate) fn images(
        &self,
        flat: &[Option<PlanarFit>],
        sample: &[Option<PlanarFit>],
        rows: usize,
    ) -> Images {
        let [height, width] = self.shape(rows);
        let [_, names] = self.names();
        let mut images = Images::new(names, height, width);
        let curve = |fits: &[Option<PlanarFit>], at: usize| Some(fits.get(at)?.as_ref()?.curve);
        let curves = |at: usize| [curve(flat, at), curve(sample, at)];
        images.take(0..height * width, curves, self.angle_per_shift);
        let contrasts = [0, 1].map(|axis| {
            let all = flat.iter().flatten().map(|fit| fit.curve.moments[axis].sqrt());
            let width = misfit::median(all.collect()).unwrap_or(f64::NAN);
            misfit::contrasts(axis, self.angle_per_shift.abs() * width)
        });
        misfit::mark(&mut images, contrasts.as_flattened());
        images
    }

    /// Expected 1 sigma of the contrasts where nothing is in the beam, median over the image, in the order of the
    /// contrasts: with the noise of counts in flat and sample alike; for weights by counts the inverse of the
    /// Fisher information. `None` where values are no counts.
    pub(crate) fn expected(&self, flat: &[Option<PlanarFit>]) -> Option<[(&'static str, f64); 6]> {
        self.options.gain?;
        let sigmas = self.sigmas(flat);
        let mut all = [("", f64::NAN); 6];
        for ((to, name), sigma) in all.iter_mut().zip(CONTRASTS).zip(sigmas) {
            *to = (name, sigma?);
        }
        Some(all)
    }

    /// Median 1 sigma of each contrast where flat and sample have the noise of these fits; `None` where no fit
    /// determines it.
    pub(super) fn sigmas(&self, flat: &[Option<PlanarFit>]) -> [Option<f64>; 6] {
        let known: Vec<[f64; 12]> = flat
            .iter()
            .flatten()
            .filter(|fit| fit.curve.has_answer())
            .map(|fit| images::contrasts(&fit.curve, &fit.curve, self.angle_per_shift))
            .collect();
        std::array::from_fn(|k| misfit::median(known.iter().map(|of| of[6 + k]).collect()))
    }

    /// Axes along which the steps do not change the light of most curves of the flat.
    pub(crate) fn blind(&self, flat: &[Option<PlanarFit>]) -> [bool; 2] {
        let known = || flat.iter().flatten().filter(|fit| fit.curve.has_answer());
        [0, 1].map(|axis| 2 * known().filter(|fit| fit.blind[axis]).count() > known().count())
    }

    /// Values of the model for a row of frames.
    pub(super) fn values_of_row(&self) -> usize {
        self.frame.shape[1] * self.values() * self.model.model.terms()
    }

    /// Values of a curve, about.
    fn values(&self) -> usize {
        match &self.curves {
            Curves::Beamlets(windows, _) => {
                windows.iter().next().map_or(0, |(_, window)| window.pixels.len())
            }
            Curves::Pixels(pairs, _) => pairs.len(),
        }
    }

    /// Flags bad pixels of the frames, `[row][column]`: pixels, or beamlets that have one.
    pub(crate) fn mark_bad(&self, images: &mut Images, bad: &Array2<bool>) {
        let flag = numbers::single(f64::from(flags::BAD_PIXEL));
        let Some(bits) = images.get_mut(FLAGS) else { return };
        match &self.curves {
            Curves::Pixels(..) => bits.zip_mut_with(bad, |bits, bad| {
                if *bad {
                    *bits = flag;
                }
            }),
            Curves::Beamlets(windows, _) => {
                let columns = windows.shape[1];
                for (at, window) in windows.iter() {
                    let is_bad = |[row, column]: &[u32; 2]| bad[[*row as usize, *column as usize]];
                    if window.pixels.iter().any(is_bad) {
                        bits[[at / columns, at % columns]] = flag;
                    }
                }
            }
        }
    }
}
