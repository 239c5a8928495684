//! Beam tracking: the light of each aperture of a sample mask over the pixels it falls on.

use super::beamlet_fit::Beamlet;
use super::method::BEAMLET_PIXELS;
use super::shape::CurveGeometry;
use beamlet_core::{Error, Result, numbers};
use beamlet_model::optics::{Mask, MaskShape, Optics};
use beamlet_model::scene::Scene;
use beamlet_model::spectrum;
use ndarray::{Array3, ArrayView3};
use std::ops::Range;

/// Where beamlets land on the detector.
#[derive(Debug, Clone)]
pub struct Beamlets {
    /// First pixel of each beamlet's window.
    starts: Vec<usize>,
    /// From beamlet to beamlet on the detector, m.
    period: f64,
    /// The light of each aperture.
    beamlets: Vec<Beamlet>,
    /// Pixels of a window.
    pixels: usize,
    /// Columns of the detector.
    columns: usize,
    /// Width of a pixel, m.
    pitch: f64,
    /// Centres of the beamlets, x from the optical axis on the detector, m.
    places: Vec<f64>,
}

impl Beamlets {
    /// Beamlets of a scene that [`super::Method::check`] let through.
    ///
    /// # Errors
    ///
    /// [`Error::Scene`] for a scene without a sample mask.
    pub fn of(scene: &Scene) -> Result<Self> {
        let optics = Optics::of(scene);
        let Some(mask) = &optics.sample_mask else {
            return Err(Error::scene("sample_mask", "nothing", "a sample mask"));
        };
        let columns = f64::from(optics.detector.pixels[0]);
        let openings = mask.openings_in_columns(&optics.detector, optics.offsets.lists()[0][0]);
        let (period, shift) = (openings.period[0], openings.offset);
        // Window of whole pixels about each centre; the detector's pixel c has its centre at c.
        let pixels = period.round().max(2.0);
        let centre = |k: f64| (k + 0.5 - columns / 2.0) * period + shift + columns / 2.0 - 0.5;
        let around = (columns / 2.0 - shift / period).floor();
        let reach = numbers::whole::<i64>((columns / period).ceil()) + 1;
        let (starts, centres): (Vec<usize>, Vec<f64>) = (-reach..=reach)
            .map(|k| centre(around + k as f64))
            .map(|centre| ((centre - (pixels - 1.0) / 2.0).round(), centre))
            .filter(|(start, _)| *start >= 0.0 && start + pixels <= columns)
            .map(|(start, centre)| (numbers::whole::<usize>(start), centre))
            .unzip();
        if starts.is_empty() {
            return Err(Error::scene(
                "detector.pixels",
                format!("{columns} columns"),
                format!("at least one beamlet of {pixels} pixels on the detector"),
            ));
        }
        let from_axis = |centre: f64| centre + 0.5 - columns / 2.0;
        let slopes: Vec<f64> = centres
            .iter()
            .map(|centre| from_axis(*centre) / optics.detector.columns_per_metre(1.0))
            .collect();
        Ok(Self {
            starts,
            period: period * optics.detector.pitch[0],
            beamlets: lights(scene, &optics, mask, &slopes)?,
            pixels: numbers::whole::<usize>(pixels),
            columns: numbers::whole::<usize>(columns),
            pitch: optics.detector.pitch[0],
            places: centres.iter().map(|c| from_axis(*c) * optics.detector.pitch[0]).collect(),
        })
    }

    /// Centres of the beamlets, x from the optical axis on the detector, m.
    pub fn places(&self) -> &[f64] {
        &self.places
    }

    /// From beamlet to beamlet on the detector, m.
    pub(crate) const fn period(&self) -> f64 {
        self.period
    }

    /// True if the pixels of a beamlet determine its width.
    pub(crate) fn determine_width(&self) -> bool {
        self.pixels as f64 >= BEAMLET_PIXELS
    }

    /// Number of beamlets along a row.
    pub(crate) fn count(&self) -> usize {
        self.starts.len()
    }

    /// Beamlets whose windows are within these columns.
    pub(crate) fn within(&self, columns: &Range<usize>) -> Range<usize> {
        let first = self.starts.partition_point(|start| *start < columns.start);
        let last = self.starts.partition_point(|start| start + self.pixels <= columns.end);
        first..last.max(first)
    }

    /// The light of the apertures, in the order of the beamlets.
    pub(crate) fn lights(&self) -> &[Beamlet] {
        &self.beamlets
    }

    /// Columns of the detector.
    pub(crate) const fn columns(&self) -> usize {
        self.columns
    }

    /// Places of a window's pixels from its middle, m on the detector.
    pub(crate) fn offsets(&self) -> Vec<f64> {
        let middle = (self.pixels - 1) as f64 / 2.0;
        (0..self.pixels).map(|i| (i as f64 - middle) * self.pitch).collect()
    }

    /// `[pixel of the window][row][beamlet]` of a single frame `[1][row][column]`.
    pub(crate) fn gather<T: Copy>(&self, frame: ArrayView3<'_, T>) -> Array3<T> {
        let (_, rows, _) = frame.dim();
        Array3::from_shape_fn((self.pixels, rows, self.starts.len()), |(pixel, row, beamlet)| {
            frame[[0, row, self.starts[beamlet] + pixel]]
        })
    }
}

/// The light of apertures seen at these dx/dy. Thick bars narrow them and blur their edges: by the
/// mean over the energies, each as far as its bars are dark.
///
/// # Errors
///
/// [`Error::Scene`] for an unknown material of the bars.
pub(crate) fn lights(
    scene: &Scene,
    optics: &Optics,
    mask: &Mask,
    slopes: &[f64],
) -> Result<Vec<Beamlet>> {
    let detector = &optics.detector;
    let plane = detector.distance;
    let blur = CurveGeometry::of(scene)?.blur.powi(2) + optics.column_blur * optics.column_blur;
    let mut shapes = Vec::new();
    if mask.side_shadow().is_some() {
        let nodes = spectrum::nodes(scene)?;
        for (energy, weight) in nodes.energies.iter().zip(&nodes.weights) {
            shapes.push((MaskShape::of(scene, mask, plane, Some(*energy))?, *weight));
        }
    }
    let openings = mask.openings(plane);
    let aperture = openings.narrowest(0);
    Ok(slopes
        .iter()
        .map(|slope| {
            let secant = slope.mul_add(*slope, 1.0).sqrt();
            let [dark, narrowing, variance] =
                shapes.iter().fold([0.0; 3], |sum, (shape, weight)| {
                    let [low, high] = shape.shadows(*slope);
                    let leak = shape.leak(secant);
                    let dark = weight * (1.0 - leak);
                    let narrowing = f64::midpoint(low, high) * shape.narrowing(secant, leak);
                    let variance = f64::midpoint(low * low, high * high) * shape.edge_variance();
                    [sum[0] + dark, sum[1] + dark * narrowing, sum[2] + dark * variance]
                });
            let mean = |sum: f64| if dark > 0.0 { sum / dark } else { 0.0 };
            // Beyond the angle at which bars hide their apertures no box is the shape.
            let width = (aperture - mean(narrowing)).max(0.05 * aperture);
            Beamlet::new(width, blur + mean(variance), [openings.period[0], detector.pitch[0]])
        })
        .collect())
}
