//! A design made ready for frames of a shape: the flat's curves once, then the images of each view.

use super::super::fitter::Weights;
use super::super::flags;
use super::super::images::Images;
use super::super::method::Method;
use super::super::misfit::{self, Noise};
use super::super::noise_factors::NoiseFactors;
use super::super::options::RetrieveOptions;
use super::fit::{PlanarFit, PlanarModel};
use super::found::{Frame, PlacedLattice};
use super::geometry::{self, Design};
use super::images;
use super::moments::by_moments;
use super::offsets;
use super::profile::Profile;
use super::scan::{PlanarNoise, PlanarValues};
use super::shape::{PlanarShape, Strip, UNKNOWNS};
use super::windows::{Window, Windows};
use beamlet_core::cancel::Cancel;
use beamlet_core::{Error, Result, numbers};
use beamlet_model::optics::{Optics, WholePeriods};
use beamlet_model::scene::Scene;
use ndarray::{Array2, ArrayView3, Axis};
use rayon::prelude::*;

/// Beamlets of the flat, about, whose centres give the lattice.
const CENTRES: usize = 400;

/// Fits by their place in the images; `None` where there is no beamlet.
pub(crate) type Fits = Vec<Option<PlanarFit>>;

/// Curves of a design.
#[derive(Debug)]
enum Curves {
    /// Beamlets in their windows, and the lattice that was found in the flat.
    Beamlets(Windows, PlacedLattice),
    /// A curve in each pixel, over these offsets, m.
    Pixels(Vec<[f64; 2]>),
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
        let (curves, model, angle_per_shift) = match design {
            Design::Beamlets(given) => {
                let placed = PlacedLattice::find(flat.index_axis(Axis(0), 0), &frame, *given)?;
                let placed = through_centres(placed, &frame, (options, flat))?;
                let windows = Windows::of(&placed, &frame)?;
                let model = beamlet_model(scene, options, (&placed, pitch))?;
                (Curves::Beamlets(windows, placed), model, 1.0 / lever)
            }
            Design::Steps(pairs) => {
                offsets::check(pairs, PlanarValues::NEEDED)?;
                let pairs = without_periods(scene, pairs);
                let model = curve_model(scene, options)?;
                (Curves::Pixels(pairs), model, -scene.magnification() / lever)
            }
        };
        Ok(Self { options: options.clone(), frame, curves, model, angle_per_shift })
    }

    /// Refraction angle per shift of a centre, rad/m.
    pub(crate) const fn angle_per_shift(&self) -> f64 {
        self.angle_per_shift
    }

    /// Rows and columns of the images, of frames of `rows` rows.
    pub(crate) fn shape(&self, rows: usize) -> [usize; 2] {
        match &self.curves {
            Curves::Beamlets(windows, _) => windows.shape,
            Curves::Pixels(_) => [rows, self.frame.shape[1]],
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
            Curves::Pixels(_) => None,
        }
    }

    /// Places of the columns of beamlets, m; `None` for pixels.
    pub(crate) fn columns_m(&self) -> Option<Vec<f64>> {
        match &self.curves {
            Curves::Beamlets(windows, _) => Some(windows.columns()),
            Curves::Pixels(_) => None,
        }
    }

    /// Fits frames `[step][row][column]`, all rows of beamlets or any rows of pixels. `flat`: fits of the same
    /// curves of the flat, `None` for the flat itself.
    ///
    /// # Errors
    /// [`Error::Scene`] for another number of frames than of offsets; [`Error::Interrupted`].
    pub(crate) fn fits(
        &self,
        frames: ArrayView3<'_, f32>,
        factors: NoiseFactors,
        flat: Option<&[Option<PlanarFit>]>,
        cancel: &Cancel,
    ) -> Result<Fits> {
        let noise = PlanarNoise {
            saturation: self.options.saturation.map_or(f64::INFINITY, f64::from),
            gain: self.options.gain.map(|gain| factors.gain(gain)),
            read_noise: factors.read_noise(self.options.read_noise),
            weights: self.options.weights,
        };
        let (steps, rows, columns) = frames.dim();
        let of_flat = |at: usize| flat.and_then(|flat| flat.get(at)?.as_ref());
        match &self.curves {
            Curves::Beamlets(windows, _) => {
                let all: Vec<(usize, &Window)> = windows.iter().collect();
                let fit = |(at, window): &(usize, &Window)| -> Result<(usize, PlanarFit)> {
                    cancel.check()?;
                    Ok((*at, self.beamlet(frames, window, &noise, of_flat(*at))))
                };
                let fitted: Vec<_> = all.par_iter().map(fit).collect::<Result<_>>()?;
                let mut fits = vec![None; windows.count()];
                for (at, fit) in fitted {
                    fits[at] = Some(fit);
                }
                Ok(fits)
            }
            Curves::Pixels(pairs) => {
                if steps != pairs.len() {
                    let found = format!("{} offsets for {steps} frames", pairs.len());
                    let allowed = "one offset for each frame";
                    return Err(Error::scene("scan.mask_offsets", found, allowed));
                }
                let fit = |at: usize| {
                    cancel.check()?;
                    let (row, column) = (at / columns, at % columns);
                    let curve = (0..steps).map(|step| frames[[step, row, column]]);
                    let values =
                        PlanarValues::of(pairs, curve, noise.saturation, PlanarValues::NEEDED);
                    Ok(Some(self.model.fit(&values, &noise, of_flat(at))))
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
        noise: &PlanarNoise,
        flat: Option<&PlanarFit>,
    ) -> PlanarFit {
        let values = values(&self.frame, frames, (window, noise.saturation));
        if self.options.method != Method::Moments {
            return self.model.fit(&values, noise, flat);
        }
        let area = self.frame.pitch[0] * self.frame.pitch[1];
        let curve = by_moments(&values, noise, (&self.model.shape, area));
        PlanarFit { curve, unknowns: [f64::NAN; UNKNOWNS], unresolved: [false; 2] }
    }

    /// Images of a view from the fits of flat and sample.
    pub(crate) fn images(
        &self,
        flat: &[Option<PlanarFit>],
        sample: &[Option<PlanarFit>],
        rows: usize,
        factors: NoiseFactors,
    ) -> Images {
        let has_sigmas = self.options.gain.is_some();
        let mut images =
            images::of_view(self.shape(rows), [flat, sample], self.angle_per_shift, has_sigmas);
        let widths = [0, 1].map(|axis| {
            let all = flat.iter().flatten().map(|fit| fit.curve.moments[axis].sqrt());
            misfit::median(all.collect())
        });
        let noise = Noise {
            gain: self.options.gain.map(|gain| factors.gain(gain)),
            read_noise: factors.read_noise(self.options.read_noise),
            steps: self.values(),
        };
        images::mark_misfits(&mut images, widths, self.angle_per_shift, noise);
        images
    }

    /// Expected 1 sigma of the contrasts where nothing is in the beam, median over the image, in the order of the
    /// contrasts: with the noise of counts in flat and sample alike; for weights by counts the inverse of the
    /// Fisher information. `None` where values are no counts.
    pub(crate) fn expected(&self, flat: &[Option<PlanarFit>]) -> Option<[(&'static str, f64); 6]> {
        self.options.gain?;
        let known: Vec<[f64; 12]> = flat
            .iter()
            .flatten()
            .filter(|fit| fit.curve.has_answer())
            .map(|fit| images::contrasts(fit, fit, self.angle_per_shift))
            .collect();
        let median = |k: usize| misfit::median(known.iter().map(|of| of[6 + k]).collect());
        let mut all = [("", f64::NAN); 6];
        for (k, (to, name)) in all.iter_mut().zip(images::CONTRASTS).enumerate() {
            *to = (name, median(k)?);
        }
        Some(all)
    }

    /// Values of a curve, about.
    fn values(&self) -> usize {
        match &self.curves {
            Curves::Beamlets(windows, _) => {
                windows.iter().next().map_or(0, |(_, window)| window.pixels.len())
            }
            Curves::Pixels(pairs) => pairs.len(),
        }
    }

    /// Flags bad pixels of the frames, `[row][column]`: pixels, or beamlets that have one.
    pub(crate) fn mark_bad(&self, images: &mut Images, bad: &Array2<bool>) {
        let flag = numbers::single(f64::from(flags::BAD_PIXEL));
        let Some(bits) = images.get_mut(super::super::images::FLAGS) else { return };
        match &self.curves {
            Curves::Pixels(_) => bits.zip_mut_with(bad, |bits, bad| {
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

/// The lattice through the centres of some of the flat's beamlets.
fn through_centres(
    placed: PlacedLattice,
    frame: &Frame,
    (options, flat): (&RetrieveOptions, ArrayView3<'_, f32>),
) -> Result<PlacedLattice> {
    let windows = Windows::of(&placed, frame)?;
    let model = gaussian(frame.pitch, Vec::new());
    let noise = PlanarNoise {
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
            let fit = model.fit(&values(frame, flat, (window, noise.saturation)), &noise, None);
            let is_fine =
                fit.curve.has_answer() && fit.curve.centre.iter().all(|at| at.is_finite());
            is_fine.then_some((window.index, fit.curve.centre))
        })
        .collect();
    Ok(placed.through(&centres).unwrap_or(placed))
}

/// Values of a beamlet's pixels.
fn values(
    frame: &Frame,
    frames: ArrayView3<'_, f32>,
    (window, saturation): (&Window, f64),
) -> PlanarValues {
    let pixels = window.pixels.iter();
    let place = |[row, column]: &[u32; 2]| frame.place(i64::from(*row), i64::from(*column));
    let places: Vec<[f64; 2]> = pixels.clone().map(place).collect();
    let values = pixels.map(|[row, column]| frames[[0, *row as usize, *column as usize]]);
    PlanarValues::of(&places, values, saturation, PlanarValues::NEEDED)
}

/// A Gaussian over pixels.
fn gaussian(pixel: [f64; 2], neighbours: Vec<[f64; 2]>) -> PlanarModel {
    let along = pixel.map(|pixel| Profile { boxes: [pixel, 0.0], shift: 0.0 });
    let shape = PlanarShape { strips: vec![Strip { share: 1.0, along }], neighbours };
    PlanarModel { shape, blur: None, pixel: Some(pixel) }
}

/// Offsets less whole periods of the sample mask.
fn without_periods(scene: &Scene, pairs: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let period = periods(scene);
    let along = [0, 1].map(|axis| {
        let all: Vec<f64> = pairs.iter().map(|pair| pair[axis]).collect();
        match period[axis].is_finite() {
            true => WholePeriods::in_scan(&all, period[axis]).without(&all),
            false => all,
        }
    });
    along[0].iter().zip(&along[1]).map(|(x, z)| [*x, *z]).collect()
}

/// Periods of the sample mask along x and z, m in its plane.
fn periods(scene: &Scene) -> [f64; 2] {
    let optics = Optics::of(scene);
    let of = |mask: &beamlet_model::optics::Mask| mask.openings(mask.distance()).period;
    optics.sample_mask.as_ref().map_or([f64::INFINITY; 2], of)
}

/// Model of beamlets over pixels.
fn beamlet_model(
    scene: &Scene,
    options: &RetrieveOptions,
    (placed, pixel): (&PlacedLattice, [f64; 2]),
) -> Result<PlanarModel> {
    let aperture = geometry::aperture(scene, options);
    let blur = geometry::blur(scene, false);
    let around = placed.lattice.around();
    match (options.method, aperture) {
        (Method::Beamlet, Some(aperture)) => {
            let shape = PlanarShape { strips: aperture.strips(pixel), neighbours: around };
            Ok(PlanarModel { shape, blur: Some(blur), pixel: Some(pixel) })
        }
        (Method::Beamlet, None) => {
            let allowed =
                "the size of the apertures for method beamlet; or method gaussian or moments";
            Err(Error::argument("aperture", "nothing", allowed))
        }
        (_, aperture) => {
            let own = aperture.map(|aperture| {
                let shape =
                    PlanarShape { strips: aperture.strips([0.0; 2]), neighbours: Vec::new() };
                shape.own_variances()
            });
            let blur = own.map(|own| [0, 1].map(|axis| own[axis] + blur[axis]));
            Ok(PlanarModel { blur, ..gaussian(pixel, around) })
        }
    }
}

/// Model of the curve of two masks over offsets.
fn curve_model(scene: &Scene, options: &RetrieveOptions) -> Result<PlanarModel> {
    if options.method == Method::Gaussian {
        let along = [Profile { boxes: [0.0; 2], shift: 0.0 }; 2];
        let shape =
            PlanarShape { strips: vec![Strip { share: 1.0, along }], neighbours: Vec::new() };
        return Ok(PlanarModel { shape, blur: None, pixel: None });
    }
    let Some([sample, detector]) = geometry::overlap(scene) else {
        let found = "apertures without ends along z";
        let allowed = "rectangles in both masks for exact-curve in two directions: use gaussian";
        return Err(Error::scene("sample_mask", found, allowed));
    };
    let along = [0, 1].map(|k| Profile { boxes: [sample[k], detector[k]], shift: 0.0 });
    let [x, z] = periods(scene);
    let all = [-1.0, 0.0, 1.0];
    let neighbours = all
        .into_iter()
        .flat_map(|i| all.into_iter().map(move |j| [i * x, j * z]))
        .filter(|[a, b]| a.is_finite() && b.is_finite() && a.abs() + b.abs() > 0.0)
        .collect();
    let shape = PlanarShape { strips: vec![Strip { share: 1.0, along }], neighbours };
    Ok(PlanarModel { shape, blur: Some(geometry::blur(scene, true)), pixel: None })
}
