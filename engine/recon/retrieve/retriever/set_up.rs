//! The set-up of a retriever by design.

use super::super::background_term::BackgroundTerm;
use super::super::beamlets::Beamlets;
use super::super::curve_model::CurveModel;
use super::super::fitter::Fitter;
use super::super::method::{Estimator, Method, different_offsets};
use super::super::model::Model;
use super::super::options::RetrieveOptions;
use super::super::planar::{Design, LatticeDesign, StepCurves};
use super::super::shape::CurveGeometry;
use super::super::value_noise::{NoiseFactors, ValueNoise};
use super::Retriever;
use super::layout::{Layout, SlitCurves};
use super::view_scan::ViewScans;
use beamlet_core::{Error, Result};
use beamlet_gpu::Compute;
use beamlet_model::optics::{Optics, WholePeriods};
use beamlet_model::scene::Scene;

impl Retriever {
    /// Makes a method ready for the set-up and the mask offsets of `scene`. Behind masks with shifts its frames are those
    /// of groups of columns, one for each offset and column, as [`Input`](crate::retrieve::Input) makes them.
    ///
    /// # Errors
    /// [`Error::Argument`] for options that cannot be; [`Error::Scene`] where the method cannot serve
    /// the set-up or the offsets;
    /// [`Error::Device`], [`Error::Memory`].
    ///
    /// # Example
    ///
    /// ```no_run
    /// use beamlet::retrieve::{Method, RetrieveOptions, Retriever};
    /// use beamlet::{Engine, EngineOptions, scene::Scene};
    ///
    /// let engine = Engine::open(&EngineOptions::default())?;
    /// let scene = Scene::load("scene.toml")?;
    /// let options = RetrieveOptions::default().with_method(Method::Moments);
    /// let retriever = Retriever::new(&engine, &scene, &options)?;
    /// println!("{:?}", retriever.names());
    /// # Ok::<(), beamlet::Error>(())
    /// ```
    pub fn new(compute: &Compute, scene: &Scene, options: &RetrieveOptions) -> Result<Self> {
        let options = &options.resolved(scene)?;
        match Design::of(scene, options)? {
            Some(design) => Self::in_two_directions(scene, &design, options),
            None => Self::of_slits(compute, scene, options),
        }
    }

    /// A retriever of steps along x and z or of beamlets on a lattice; the options have method and background.
    pub(in crate::retrieve) fn in_two_directions(
        scene: &Scene,
        design: &Design,
        options: &RetrieveOptions,
    ) -> Result<Self> {
        design.check(scene, options)?;
        options.check_values()?;
        let (layout, offsets, whole_periods, view_scans) = match design {
            Design::Beamlets(lattice) => {
                let design = LatticeDesign::of(scene, options, *lattice);
                (Layout::Lattice(design, None), vec![[0.0; 2]], 0.0, None)
            }
            Design::Steps(pairs) => {
                let (curves, offsets) = StepCurves::of(scene, options, pairs)?;
                let first = pairs.first().zip(offsets.first());
                let whole_periods = first.map_or(0.0, |(all, own)| all[0] - own[0]);
                let of_view = |x: &[f64]| StepCurves::offsets_of_view(scene, x, [pairs, &offsets]);
                let view_scans = ViewScans::of(scene, of_view)?;
                (Layout::Steps(curves), offsets, whole_periods, view_scans)
            }
        };
        Ok(Self {
            options: options.clone(),
            whole_periods,
            offsets,
            view_scans,
            angle_per_shift: angle_per_shift(scene, &layout),
            layout,
            flat: None,
        })
    }

    /// A retriever of slits along z.
    fn of_slits(compute: &Compute, masks: &Scene, options: &RetrieveOptions) -> Result<Self> {
        let (method, scene) = (options.method(), &masks.of_groups());
        let period = Optics::of(masks).pattern_period();
        let periods = WholePeriods::in_scan(&scene.scan.mask_offsets, period);
        let view_scans = ViewScans::of_slits(scene, method, periods)?;
        method.check(scene, &scene.scan.mask_offsets)?;
        let least = options.background().least_offsets(method);
        let different = different_offsets(&scene.scan.mask_offsets);
        if different < least {
            let found = format!("{different} different offsets");
            let allowed =
                format!("at least {least} for {method} with a free background; or background leak");
            return Err(Error::scene("scan.mask_offsets", found, allowed));
        }
        options.check_values()?;
        let offsets = periods.without(&scene.scan.mask_offsets);
        let layout = if method == Method::Beamlet {
            Layout::Beamlets(Beamlets::of(scene)?)
        } else {
            let shape = CurveGeometry::of(masks)?.with_background(options.background(), scene)?;
            let model = Model::of(method, &shape);
            let model =
                model.ok_or_else(|| Error::scene("detector_mask", "nothing", "both masks"))?;
            let background = match method.has_background() {
                true => shape.background,
                false => BackgroundTerm::Free,
            };
            let fitter = match method.estimator() == Estimator::Device {
                true => {
                    let noise = ValueNoise::of(options, NoiseFactors::ONE);
                    Some(Fitter::new(compute, &offsets, noise, background)?)
                }
                false => None,
            };
            let curve = CurveModel::of_slits(model, background, shape.spread());
            Layout::Pixels(SlitCurves { fitter, shape, curve })
        };
        Ok(Self {
            options: options.clone(),
            whole_periods: periods.length(),
            offsets: offsets.into_iter().map(|x| [x, 0.0]).collect(),
            view_scans,
            angle_per_shift: angle_per_shift(scene, &layout),
            layout,
            flat: None,
        })
    }
}

/// Refraction angle per shift of a curve's centre, rad/m: of beamlets on the detector, or of a scan of the sample mask.
fn angle_per_shift(scene: &Scene, layout: &Layout) -> f64 {
    let per_shift = if layout.has_beamlets() { 1.0 } else { -scene.magnification() };
    per_shift / scene.lever_arm()
}
