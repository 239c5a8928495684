//! The grid that takes the light behind the detector mask: where the detector blurs, pixels are
//! cut into parts small enough that where light lies within a part does not matter, and light
//! beside the detector that blurs into it is taken up too.

use super::kernel::{KernelOf, Measured, Spread};
use super::spread::Window;
use beamlet_core::{Result, numbers};
use beamlet_model::optics::Optics;
use beamlet_model::scene::{Blur, Scatter, Scene};
use serde::Serialize;
use std::ops::Range;

/// Most parts of a pixel along x and z.
const MOST: [u32; 2] = [64, 16];
/// Error of a pixel, in open beam, that parts along x and z may make: sharp edges of light at
/// their worst place. Along z those are silhouettes, which have a tolerance of their own.
const TOLERANCE: [f64; 2] = [2e-4, 5e-3];
/// The same where an aperture is lit evenly, edge to edge: parts whose borders fall on the edges
/// of apertures make none.
const EVEN: f64 = 2e-5;

/// Parts and margins of the grid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SubpixelGrid {
    /// Columns and rows of the detector.
    pub pixels: [u32; 2],
    /// Parts of a pixel along x and z; each takes up light of its own.
    pub parts: [u32; 2],
    /// Pixels beside the detector, on either side, whose light is taken up.
    pub margin: [u32; 2],
    /// Rows over which scattered light spreads, on either side.
    pub scatter_rows: u32,
    /// Most that the parts change a pixel, in open beam: sharp edges of light at their worst
    /// place. 0 without blur.
    pub error: f64,
    /// Bytes that the kernels of blur and scatter take beside the light.
    #[serde(skip)]
    pub(crate) kernel_bytes: u64,
}

impl SubpixelGrid {
    /// The grid of a scene.
    ///
    /// # Errors
    /// [`beamlet_core::Error::File`], [`beamlet_core::Error::Scene`] for a kernel that cannot be read.
    pub(crate) fn of(scene: &Scene) -> Result<Self> {
        let detector = &scene.detector;
        let spread = match &detector.blur {
            Some(Blur::Gaussian { sigma }) => {
                // Along z there is no mask between the sample and the detector: such a blur adds to the
                // blur of the spot, and rows need no parts. Apertures that end along z are such a mask.
                let along = |axis: usize| Spread::Gaussian(sigma[axis] / detector.pitch[axis]);
                [Some(along(0)), scene.has_heights().then(|| along(1))]
            }
            Some(Blur::Kernel(kernel)) => {
                let measured = Measured::read(scene, kernel, KernelOf::Blur)?;
                [Some(measured.profile(0)), Some(measured.profile(1))]
            }
            None => [None, None],
        };
        let (pixels, parts, margin) = (detector.pixels, [1; 2], [0; 2]);
        let mut grid = Self { pixels, parts, margin, scatter_rows: 0, error: 0.0, kernel_bytes: 0 };
        for (axis, spread) in spread.iter().enumerate() {
            let Some(spread) = spread.as_ref().filter(|spread| spread.reach() > 0.0) else {
                continue;
            };
            grid.margin[axis] = numbers::whole::<u32>(spread.reach().ceil());
            let lit = if axis == 0 { lit_width(scene) } else { 1.0 };
            // Edges of apertures along z are edges of light as those along x are.
            let edges = if scene.has_heights() { 0 } else { axis };
            let (most, tolerance) = (MOST[edges], TOLERANCE[edges]);
            let (mut chosen, mut chosen_error) = (0, f64::INFINITY);
            for parts in 1..=most {
                let [sharp, even] = error_of(spread, parts, lit);
                let fine = sharp <= tolerance;
                let aligned = even <= EVEN;
                // The first that is fine, unless a later one is aligned as well; or the finest.
                if chosen_error > tolerance || (fine && aligned) {
                    (chosen, chosen_error) = (parts, sharp);
                }
                if fine && aligned {
                    break;
                }
            }
            grid.parts[axis] = chosen;
            grid.error = grid.error.max(chosen_error);
        }
        if let Some(Scatter::Kernel { kernel, .. }) = &detector.scatter {
            let measured = Measured::read(scene, kernel, KernelOf::Scatter)?;
            let [across, down] =
                [0, 1].map(|axis| numbers::whole::<u32>(measured.profile(axis).reach().ceil()));
            grid.scatter_rows = down;
            grid.kernel_bytes += grid.bytes_of_window([across, down], [1; 2]);
        }
        grid.kernel_bytes += grid.bytes_of_window(grid.margin, grid.parts);
        Ok(grid)
    }

    /// Bytes of a window of pixels this far on either side.
    fn bytes_of_window(&self, margin: [u32; 2], parts: [u32; 2]) -> u64 {
        let [columns, rows] =
            [0, 1].map(|axis| (2 * margin[axis] as usize + 1) * parts[axis] as usize);
        Window::bytes([rows, columns], parts.map(|n| n as usize), self.pixels[0] as usize)
    }

    /// Columns and rows of the grid.
    #[must_use]
    pub(crate) fn size(&self) -> [u32; 2] {
        [0, 1].map(|axis| self.parts[axis] * (self.pixels[axis] + 2 * self.margin[axis]))
    }

    /// The optics with this grid in place of the detector, for tracing and illumination.
    #[must_use]
    pub(crate) fn optics(&self, scene: &Scene) -> Optics {
        Optics::on_grid(scene, self.size(), self.parts)
    }

    /// Rows of the detector that a band of its rows takes light from.
    #[must_use]
    pub(crate) fn needed(&self, band: &Range<u32>) -> Range<u32> {
        let reach = self.scatter_rows;
        band.start.saturating_sub(reach)..(band.end.saturating_add(reach)).min(self.pixels[1])
    }

    /// Rows of the grid that a band of the detector's rows takes light from.
    #[must_use]
    pub(crate) fn lit_rows(&self, band: &Range<u32>) -> Range<u32> {
        let needed = self.needed(band);
        let [_, parts] = self.parts;
        needed.start * parts..(needed.end + 2 * self.margin[1]) * parts
    }

    /// Rows of the grid that are counted with a band: each once, over all bands.
    #[must_use]
    pub(crate) fn own_rows(&self, band: &Range<u32>) -> Range<u32> {
        let [_, parts] = self.parts;
        let start = if band.start == 0 { 0 } else { band.start + self.margin[1] };
        let last = band.end == self.pixels[1];
        let end = band.end + self.margin[1] * if last { 2 } else { 1 };
        start * parts..end * parts
    }
}

/// Width of the light behind the detector mask, pixels, if it has the same position in every pixel; 1 if
/// it may be anywhere.
fn lit_width(scene: &Scene) -> f64 {
    let optics = Optics::of(scene);
    let Some(mask) = &optics.detector_mask else { return 1.0 };
    let pixels = &optics.detector;
    let openings = mask.openings_in_columns(pixels, 0.0);
    let aligned = (openings.period[0] - 1.0).abs() < 1e-6 && openings.offset.abs() < 1e-6;
    if aligned { openings.span().min(1.0) } else { 1.0 }
}

/// Most that `parts` of a pixel change it, or one beside it: light of open beam between two sharp
/// edges anywhere in the lit middle of a pixel, and between the edges of that middle.
fn error_of(spread: &Spread, parts: u32, lit: f64) -> [f64; 2] {
    let reach = numbers::whole::<i32>(spread.reach().ceil());
    let parts = f64::from(parts);
    // Of the light up to x the parts give the straight line between their borders.
    let off = |x: f64| {
        let low = (x * parts).floor() / parts;
        let high = low + 1.0 / parts;
        let share = (x - low) * parts;
        let line = spread.landed(low) * (1.0 - share) + spread.landed(high) * share;
        spread.landed(x) - line
    };
    let samples = numbers::whole::<i32>((8.0 * parts * lit).ceil().max(8.0));
    (-reach..=reach)
        .map(|pixel| {
            let at =
                |i: i32| 0.5 + lit * (f64::from(i) / f64::from(samples) - 0.5) + f64::from(pixel);
            let errors = (0..=samples).map(|i| off(at(i)));
            let (least, most) =
                errors.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), e| (a.min(e), b.max(e)));
            [most - least, (off(at(samples)) - off(at(0))).abs()]
        })
        .fold([0.0; 2], |a, b| [a[0].max(b[0]), a[1].max(b[1])])
}
