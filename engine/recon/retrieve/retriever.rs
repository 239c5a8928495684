//! One method on one set-up: the flat's curves once, then the images of each view.

mod fits;
mod flat;
mod image_places;
mod layout;
mod set_up;
mod view_scan;

use super::beamlets::Beamlets;
use super::flags;
use super::images::{self, FLAGS, Images};
use super::input::Input;
use super::joined::JoinedColumns;
use super::method::Method;
use super::misfit;
use super::options::{ReadRows, RetrieveOptions};
use beamlet_core::rows_control::RowsControl;
use beamlet_core::{Error, Result, numbers};
use beamlet_files::GeometryFile;
use flat::Flat;
pub(super) use image_places::ImagePlaces;
pub(super) use layout::Layout;
use ndarray::{Array2, Array3, ArrayView3, s};
use std::ops::Range;
pub(crate) use view_scan::Corrected;
use view_scan::ViewScans;

/// Bytes of a band of rows with all its steps, for fits on the device; on the host, where a band
/// takes seconds, a sixteenth of it, so that a retrieval can be stopped.
const BAND: usize = 48 << 20;

/// A method made ready for a set-up.
#[derive(Debug)]
pub struct Retriever {
    options: RetrieveOptions,
    /// Whole periods of the sample mask along x, m, that offsets of the scan have more than these.
    whole_periods: f64,
    /// Offsets x and z of the steps without whole periods, m; z of slits is 0.
    offsets: Vec<[f64; 2]>,
    /// Offsets of each angle, if they differ from the flat's.
    view_scans: Option<ViewScans>,
    layout: Layout,
    /// Refraction angle per shift of the centre.
    angle_per_shift: f64,
    flat: Option<Flat>,
}

impl Retriever {
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
        match &self.layout {
            Layout::Pixels(_) | Layout::Steps(_) | Layout::Lattice(_, None) => input.columns_m(),
            Layout::Beamlets(beamlets) => beamlets.places().to_vec(),
            Layout::Lattice(_, Some(beamlets)) => beamlets.columns_m(),
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
    pub(super) fn offsets(&self) -> [&[[f64; 2]]; 2] {
        let of_sample = if self.view_scans.is_some() { &[] } else { &self.offsets[..] };
        [&self.offsets, of_sample]
    }

    /// Offsets of the flat's steps, without whole periods, m.
    pub(super) fn flat_offsets(&self) -> &[[f64; 2]] {
        &self.offsets
    }

    /// Offsets of the steps of a view of the sample, without whole periods, m.
    ///
    /// # Errors
    /// As [`Retriever::retrieve`].
    pub(super) fn offsets_of_view(&self, view: usize) -> Result<Vec<[f64; 2]>> {
        Ok(self.own_offsets(view)?.unwrap_or(&self.offsets).to_vec())
    }

    /// Size of a pixel of the images, x and z, m, of frames with pixels of this size.
    pub(super) fn pitch(&self, pixel: [f64; 2]) -> [f64; 2] {
        self.layout.pitch(pixel)
    }

    /// Rows and columns of the images, in rectangles, whose values are all in these rows and columns of the frames.
    ///
    /// # Errors
    /// [`Error::Argument`] where no whole beamlet is in them.
    pub(super) fn curves_within(
        &self,
        pixels: &[Range<usize>; 2],
    ) -> Result<Vec<[Range<usize>; 2]>> {
        let places = self.layout.within(pixels);
        if !places.is_empty() {
            return Ok(places);
        }
        let [rows, columns] = pixels;
        let found =
            format!("columns {}:{}, rows {}:{}", columns.start, columns.end, rows.start, rows.end);
        Err(Error::argument("empty_beam", found, "pixels of a whole beamlet"))
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
        self.whole_periods
    }

    /// The curves.
    pub(super) const fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The resolved options.
    pub(super) const fn options(&self) -> &RetrieveOptions {
        &self.options
    }

    /// True if curves determine their width, and images have a dark field.
    pub(super) fn has_width(&self) -> bool {
        let has_pixels = self.layout.beamlets().is_none_or(Beamlets::determine_width);
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
        let is_planar = self.layout.is_planar();
        let of_width = |name: &str| name.starts_with("dark_field") || name == "flat_width_sigma";
        images::names(|name| {
            let is_sigma = name.ends_with("_sigma");
            (is_planar || !images::is_of_z(name))
                && (has_sigmas || !is_sigma)
                && !(is_planar && is_sigma && name.starts_with("flat_"))
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
        let [down, across] = flat.shape;
        let mut images = Images::new(self.names(), down, across);
        let rows = numbers::count(flat.frame_rows);
        self.bands(rows, columns, control, |band, control| {
            let data = read(band.clone())?;
            let first = band.start as usize * across;
            let known = Some((&flat.curves, first));
            let curves = self.curves((data, band.start), &scan, known, &control.cancel)?;
            let of = |at: usize| [flat.curves.curve(at), curves.curve(at - first)];
            images.take(first..first + curves.len(), of, self.angle_per_shift);
            Ok(())
        })?;
        if flat.widths.iter().any(|width| width.is_finite()) {
            let of_axis = |axis: usize| self.angle_per_shift.abs() * flat.widths[axis];
            let contrasts = [0, 1].map(|axis| misfit::contrasts(axis, of_axis(axis)));
            let count = if self.layout.is_planar() { 2 } else { 1 };
            misfit::mark(&mut images, contrasts[..count].as_flattened());
        }
        Ok(images)
    }

    /// Flags bad pixels of the frames, `[row][column]`, in the images of a view: pixels, or beamlets that
    /// have one. They hold this flag alone.
    pub(super) fn mark_bad(&self, images: &mut Images, bad: &Array2<bool>) {
        let of_images = self.layout.touched(bad);
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
        if self.flat.as_ref().is_some_and(|flat| flat.frame_rows != rows) {
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
        control: &mut RowsControl<'_>,
        mut work: impl FnMut(Range<u32>, &mut RowsControl<'_>) -> Result<()>,
    ) -> Result<()> {
        let row_bytes = (4 * self.offsets.len() * columns).max(1);
        let bytes = if self.layout.fitter().is_some() { BAND } else { BAND / 16 };
        let height = match self.layout.needs_whole_frames() {
            true => rows,
            false => numbers::at_most(bytes / row_bytes).max(1),
        };
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

fn part(stack: ArrayView3<'_, f32>, band: &Range<u32>) -> Array3<f32> {
    stack.slice(s![.., band.start as usize..band.end as usize, ..]).to_owned()
}
