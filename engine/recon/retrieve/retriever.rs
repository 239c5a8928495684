//! One method on one set-up: the flat's curves once, then the images of each view.

mod fits;
mod flat;
mod view_scan;

use super::beamlets::Beamlets;
use super::fitter::{FitOptions, Fitter, Weights};
use super::flags;
use super::images::{self, FLAGS, Images};
use super::input::Input;
use super::joined::JoinedColumns;
use super::method::{Method, different_offsets};
use super::misfit;
use super::options::{ReadRows, RetrieveOptions};
use super::shape::CurveGeometry;
use beamlet_core::rows_control::RowsControl;
use beamlet_core::{Error, Result, numbers};
use beamlet_files::GeometryFile;
use beamlet_gpu::Compute;
use beamlet_model::optics::{Optics, WholePeriods};
use beamlet_model::scene::Scene;
use flat::Flat;
use ndarray::{Array2, Array3, ArrayView3, Axis, s};
use std::ops::Range;
pub(crate) use view_scan::Corrected;
pub(super) use view_scan::ViewScan;
use view_scan::ViewScans;

/// Bytes of a band of rows with all its steps, for fits on the device; on the host, where a band
/// takes seconds, a sixteenth of it, so that a retrieval can be stopped.
const BAND: usize = 48 << 20;

/// A method made ready for a set-up.
#[derive(Debug)]
pub struct Retriever {
    options: RetrieveOptions,
    periods: WholePeriods,
    /// Offsets without these periods, m.
    offsets: Vec<f64>,
    /// Offsets of each angle, if they differ from the flat's.
    view_scans: Option<ViewScans>,
    fitter: Option<Fitter>,
    beamlets: Option<Beamlets>,
    shape: CurveGeometry,
    /// Refraction angle per shift of the centre.
    angle_per_shift: f64,
    flat: Option<Flat>,
}

impl Retriever {
    /// Makes a method ready for the set-up and the mask offsets of `scene`.
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
        let method = options.method();
        refuse_shifts(scene)?;
        let period = Optics::of(scene).curve_period();
        let periods = WholePeriods::in_scan(&scene.scan.mask_offsets, period);
        let view_scans = ViewScans::of(scene, method, periods)?;
        method.check(scene, &scene.scan.mask_offsets)?;
        let least = options.background().least_offsets(method);
        let different = different_offsets(&scene.scan.mask_offsets);
        if different < least {
            let found = format!("{different} different offsets");
            let allowed =
                format!("at least {least} for {method} with a free background; or background leak");
            return Err(Error::scene("scan.mask_offsets", found, allowed));
        }
        let offsets = periods.without(&scene.scan.mask_offsets);
        let fits = method == Method::Gaussian;
        if options.weights == Weights::Poisson && !method.weighs() {
            let allowed = "poisson with gaussian, exact-curve or beamlet";
            return Err(Error::argument("weights", format!("poisson with {method}"), allowed));
        }
        if let Some(gain) = options.gain.filter(|gain| !(gain.is_finite() && *gain > 0.0)) {
            return Err(Error::argument("gain", gain.to_string(), "a finite number above 0"));
        }
        if !(options.read_noise.is_finite() && options.read_noise >= 0.0) {
            let found = format!("{}", options.read_noise);
            return Err(Error::argument("read_noise", found, "a finite number of 0 or more"));
        }
        options.check_saturation()?;
        let beamlets = if method == Method::Beamlet { Some(Beamlets::of(scene)?) } else { None };
        let shape = CurveGeometry::of(scene)?.with_background(options.background(), scene)?;
        let fit_options = FitOptions {
            weights: options.weights,
            gain: options.gain.unwrap_or(1.0),
            read_noise: options.read_noise,
            saturation: options.saturation,
            background: shape.background,
        };
        let lever = scene.lever_arm();
        Ok(Self {
            options: options.clone(),
            fitter: if fits { Some(Fitter::new(compute, &offsets, &fit_options)?) } else { None },
            angle_per_shift: if beamlets.is_some() {
                1.0 / lever
            } else {
                -scene.magnification() / lever
            },
            beamlets,
            shape,
            periods,
            offsets,
            view_scans,
            flat: None,
        })
    }

    /// Geometry of the images of the first `angles` angles of an input: columns of pixels or beamlets,
    /// all dithers side by side.
    pub(super) fn geometry(&self, input: &Input, angles: usize) -> GeometryFile {
        let mut scene = input.image_scene();
        scene.scan.dithers.clear();
        GeometryFile::with_columns(&scene, self.columns_m(input), angles)
    }

    /// Places of the columns of the images, x from the optical axis on the detector, m, ascending.
    pub(super) fn columns_m(&self, input: &Input) -> Vec<f64> {
        match self.joined(input) {
            Some(joined) => joined.places().to_vec(),
            None => self.places(input),
        }
    }

    /// Places of the columns of a view, beamlets or pixels, as in the images.
    pub(super) fn places(&self, input: &Input) -> Vec<f64> {
        match &self.beamlets {
            Some(beamlets) => beamlets.places().to_vec(),
            None => input.columns_m(),
        }
    }

    /// Columns of the dithers of an input side by side; `None` without dithers.
    pub(super) fn joined(&self, input: &Input) -> Option<JoinedColumns> {
        JoinedColumns::of(input.scene(), &self.places(input))
    }

    /// Frames of the flat, and of each view of the sample.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.offsets.len()
    }

    /// Offsets of the flat's and the sample's steps, without whole periods, m; none of a sample whose views
    /// have offsets of their own.
    pub(super) fn offsets(&self) -> [&[f64]; 2] {
        let of_sample = if self.view_scans.is_some() { &[] } else { &self.offsets[..] };
        [&self.offsets, of_sample]
    }

    /// Offsets of the flat's steps, without whole periods, m.
    pub(super) fn flat_offsets(&self) -> &[f64] {
        &self.offsets
    }

    /// Offsets of the steps of a view of the sample, without whole periods, m.
    ///
    /// # Errors
    /// As [`Retriever::retrieve`].
    pub(super) fn offsets_of_view(&self, view: usize) -> Result<Vec<f64>> {
        Ok(self.own_offsets(view)?.unwrap_or(&self.offsets).to_vec())
    }

    /// Size of a pixel of the images, x and z, m, of frames with pixels of this size.
    pub(super) fn pitch(&self, [x, z]: [f64; 2]) -> [f64; 2] {
        [self.beamlets.as_ref().map_or(x, Beamlets::period), z]
    }

    /// Columns of the images whose values are all in these columns of the frames.
    pub(super) fn curves_within(&self, columns: Range<usize>) -> Range<usize> {
        self.beamlets.as_ref().map_or(columns.clone(), |beamlets| beamlets.within(&columns))
    }

    /// Refraction angle per metre of shift of a curve's centre: -M/z for a scan of the sample
    /// mask, 1/z for beamlets on the detector.
    #[must_use]
    pub const fn angle_per_shift(&self) -> f64 {
        self.angle_per_shift
    }

    /// Whole periods of the sample mask, m, that offsets of the scan have more than the centres of
    /// curves: 0 where the middle of the scan is within half a period of 0.
    #[must_use]
    pub fn whole_periods(&self) -> f64 {
        self.periods.length()
    }

    /// Masks and spot, as their curve depends on them.
    pub(super) const fn curve_geometry(&self) -> &CurveGeometry {
        &self.shape
    }

    /// True of beamlets on their pixels, which have no curve over mask offsets.
    pub(super) const fn has_beamlets(&self) -> bool {
        self.beamlets.is_some()
    }

    /// The resolved options.
    pub(super) const fn options(&self) -> &RetrieveOptions {
        &self.options
    }

    /// The fits on the device; `None` of methods without.
    pub(super) const fn fitter(&self) -> Option<&Fitter> {
        self.fitter.as_ref()
    }

    /// True if curves determine their width, and images have a dark field.
    pub(super) fn has_width(&self) -> bool {
        let has_pixels = self.beamlets.as_ref().is_none_or(Beamlets::determine_width);
        has_pixels && self.options.method() != Method::TwoStep
    }

    /// Names of the images of a view.
    #[must_use]
    pub fn names(&self) -> Vec<&'static str> {
        let [_, of_view] = self.names_of_images();
        of_view
    }

    /// Names of the images of the flat and of a view. Without noise there is nothing to be uncertain of.
    pub(super) fn names_of_images(&self) -> [Vec<&'static str>; 2] {
        let (has_width, has_sigmas) = (self.has_width(), self.options.gain.is_some());
        let of_width = |name: &str| name.starts_with("dark_field") || name == "flat_width_sigma";
        images::names(|name| {
            !images::is_of_z(name)
                && (has_sigmas || !name.ends_with("_sigma"))
                && (has_width || !of_width(name))
        })
    }

    /// The images of the view of this index, at its own mask offsets; the flat comes first.
    ///
    /// # Errors
    /// As [`Retriever::set_flat`], and where there is no flat, or the scene has offsets of fewer views.
    pub fn retrieve(
        &self,
        view: usize,
        columns: usize,
        read: &mut ReadRows<'_>,
        control: &mut RowsControl<'_>,
    ) -> Result<Images> {
        self.retrieve_corrected(view, Corrected::NONE, columns, read, control)
    }

    /// As [`Retriever::retrieve`], of frames that were corrected.
    ///
    /// # Errors
    /// As [`Retriever::retrieve`].
    pub(super) fn retrieve_corrected(
        &self,
        view: usize,
        corrected: Corrected<'_>,
        columns: usize,
        read: &mut ReadRows<'_>,
        control: &mut RowsControl<'_>,
    ) -> Result<Images> {
        let Some(flat) = &self.flat else {
            return Err(Error::argument("flat", "no flat was taken", "the flat, then the views"));
        };
        if columns != flat.frame_columns {
            let found = format!("frames of {columns} columns after {}", flat.frame_columns);
            return Err(Error::argument(
                "sample",
                found,
                "frames of one shape for flat and sample",
            ));
        }
        let scan = self.view_scan(view, corrected)?;
        let across = flat.columns;
        let mut images = Images::new(self.names(), flat.rows, across);
        let rows = numbers::count(flat.rows);
        self.bands(rows, columns, self.offsets.len(), control, |band, control| {
            let data = read(band.clone())?;
            let pixels = band.start as usize * across..band.end as usize * across;
            let known = Some((&flat.curves, pixels.start));
            let curves = self.curves(data, &scan, known, &control.cancel)?;
            let first = pixels.start;
            let of = |at: usize| [flat.curves.curve(at), curves.curve(at - first)].map(Some);
            images.take(pixels, of, self.angle_per_shift);
            Ok(())
        })?;
        if let Some(width) = flat.width {
            misfit::mark(&mut images, &misfit::contrasts(0, self.angle_per_shift.abs() * width));
        }
        Ok(images)
    }

    /// Flags bad pixels of the frames, `[row][column]`, in the images of a view: pixels, or beamlets that
    /// have one. They hold this flag alone.
    pub(super) fn mark_bad(&self, images: &mut Images, bad: &Array2<bool>) {
        let of_images = match &self.beamlets {
            Some(beamlets) => beamlets.gather(bad.view().insert_axis(Axis(0))).fold_axis(
                Axis(0),
                false,
                |any, bad| *any || *bad,
            ),
            None => bad.clone(),
        };
        if let Some(bits) = images.get_mut(FLAGS) {
            bits.zip_mut_with(&of_images, |bits, bad| {
                if *bad {
                    *bits = numbers::single(f64::from(flags::BAD_PIXEL));
                }
            });
        }
    }

    /// The images of the first view, from an array `[step][row][column]`; of any view, where all have the
    /// mask offsets of the flat.
    ///
    /// # Errors
    /// As [`Retriever::retrieve`].
    ///
    /// # Example
    ///
    /// ```no_run
    /// use beamlet::retrieve::{RetrieveOptions, Retriever};
    /// use beamlet::{Engine, EngineOptions, scene::Scene};
    /// use ndarray::Axis;
    ///
    /// let engine = Engine::open(&EngineOptions::default())?;
    /// let scene = Scene::load("scene.toml")?;
    /// let stacks = engine.simulate(&scene)?;
    /// let mut retriever = Retriever::new(&engine, &scene, &RetrieveOptions::default())?;
    /// retriever.set_flat_array(stacks.flat.view())?;
    /// let images = retriever.retrieve_array(stacks.sample.index_axis(Axis(0), 0))?;
    /// # Ok::<(), beamlet::Error>(())
    /// ```
    pub fn retrieve_array(&self, sample: ArrayView3<'_, f32>) -> Result<Images> {
        self.retrieve_array_of(0, sample)
    }

    /// As [`Retriever::retrieve_array`], of the view of this index.
    ///
    /// # Errors
    /// As [`Retriever::retrieve`].
    pub fn retrieve_array_of(&self, view: usize, sample: ArrayView3<'_, f32>) -> Result<Images> {
        let (_, rows, columns) = sample.dim();
        if self.flat.as_ref().is_some_and(|flat| flat.rows != rows) {
            let allowed = "frames of one shape for flat and sample";
            return Err(Error::argument("sample", format!("{rows} rows"), allowed));
        }
        let mut read = |band| Ok(part(sample, &band));
        self.retrieve(view, columns, &mut read, &mut RowsControl::default())
    }

    /// Calls `work` for bands of rows.
    fn bands(
        &self,
        rows: u32,
        columns: usize,
        steps: usize,
        control: &mut RowsControl<'_>,
        mut work: impl FnMut(Range<u32>, &mut RowsControl<'_>) -> Result<()>,
    ) -> Result<()> {
        let row_bytes = (4 * steps * columns).max(1);
        let bytes = if self.fitter.is_some() { BAND } else { BAND / 16 };
        let height = numbers::at_most(bytes / row_bytes).max(1);
        let mut start = 0;
        while start < rows {
            control.cancel.check()?;
            let end = rows.min(start.saturating_add(height));
            work(start..end, control)?;
            if let Some(progress) = &mut control.progress {
                progress(u64::from(end - start), u64::from(rows));
            }
            start = end;
        }
        Ok(())
    }
}

/// Refuses masks with shifts: frames of a retriever have one curve in each pixel.
fn refuse_shifts(scene: &Scene) -> Result<()> {
    for (key, mask) in scene.masks() {
        if !mask.shifts.is_empty() {
            let found = format!("{} shifts", mask.shifts.len());
            let allowed = "no shifts: `Input` makes curves of the columns of a group, and \
                           `Scene::of_groups` is their scene";
            return Err(Error::scene(format!("{key}.shifts"), found, allowed));
        }
    }
    Ok(())
}

fn part(stack: ArrayView3<'_, f32>, band: &Range<u32>) -> Array3<f32> {
    stack.slice(s![.., band.start as usize..band.end as usize, ..]).to_owned()
}
