//! Elements of the beam, in f64: distances, masks, the plane of the detector and the focal spot.
//!
//! [`Optics`] is made once per run. With blur, its detector plane is the subpixel grid and not the
//! scene's detector: tracing and illumination take an [`Optics`], writing takes the [`Scene`].

mod bars;
mod column_places;
mod detector_plane;
mod mask;
mod periods;
mod strips;
mod thin_curve;
mod view_geometry;
mod view_offsets;
pub mod waves;

pub use crate::scene::Strip;
pub use bars::{
    MaskShape, leak_over_mean, mean_leaks, modulated, straightened, through_sample_mask,
    through_substrates,
};
pub use detector_plane::DetectorPlane;
pub use mask::{Mask, Openings};
pub use periods::{WholePeriods, ends};
pub use strips::{FrontView, Strips};
pub use thin_curve::ThinCurve;
pub use view_geometry::ViewGeometry;
pub(crate) use view_offsets::ViewOffsets;

use crate::scene::{Blur, MaskSpec, Sampling, Scene};
use crate::spot::{Spot, deviation};

/// Elements of the beam of a run, and the fineness of its sampling.
#[derive(Debug, Clone, PartialEq)]
pub struct Optics {
    /// Source to rotation centre, m.
    pub rotation: f64,
    /// Source to the plane of the cells, m.
    pub cell_plane: f64,
    /// Source to the analyser, m.
    pub analyser: f64,
    /// Axis of rotation to analyser, m.
    pub lever_arm: f64,
    /// The pixels that take the light.
    pub detector: DetectorPlane,
    /// Columns of these to a pixel of the detector.
    pub column_parts: u32,
    /// Standard deviation of the blur of the detector along x, m; 0 where it is measured as a kernel.
    pub column_blur: f64,
    /// The mask before the sample.
    pub sample_mask: Option<Mask>,
    /// The mask before the detector.
    pub detector_mask: Option<Mask>,
    /// The focal spot, with the blur of the detector along z.
    pub spot: Spot,
    /// Displacements of the sample mask.
    pub offsets: ViewOffsets,
    /// How rays are chosen, by the pixels of `detector`.
    pub sampling: Sampling,
}

impl Optics {
    /// The optics of a scene whose detector takes its light in whole pixels, as it does without
    /// blur.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        Self::on_grid(scene, scene.detector.pixels, [1; 2])
    }

    /// The optics of a scene whose detector takes its light in smaller pixels: `parts` of them to a
    /// pixel along x and z, `size` columns and rows in all. Masks stay where they are.
    #[must_use]
    pub fn on_grid(scene: &Scene, size: [u32; 2], parts: [u32; 2]) -> Self {
        let detector = DetectorPlane {
            distance: scene.detector.distance,
            pixels: size,
            pitch: [0, 1].map(|axis| scene.detector.pitch[axis] / f64::from(parts[axis])),
        };
        let mask = |name, spec: &Option<_>| {
            let [columns, rows] = scene.detector.pixels;
            spec.as_ref().map(|spec| Mask::new(name, spec, size[0], columns).before_rows(rows))
        };
        let mut sampling = scene.sampling.clone();
        sampling.rays = sampling.rays.of_part(parts);
        Self {
            rotation: scene.source.distance,
            cell_plane: scene.cell_plane_distance(),
            analyser: scene.analyser_distance(),
            lever_arm: scene.lever_arm(),
            detector,
            column_parts: parts[0],
            column_blur: match &scene.detector.blur {
                Some(Blur::Gaussian { sigma }) => sigma[0],
                Some(Blur::Kernel(_)) | None => 0.0,
            },
            sample_mask: mask("sample_mask", &scene.sample_mask),
            detector_mask: mask("detector_mask", &scene.detector_mask),
            spot: spot(scene),
            offsets: view_offsets(scene),
            sampling,
        }
    }

    /// True if apertures of a mask end along z.
    pub fn has_heights(&self) -> bool {
        self.sample_mask.iter().chain(&self.detector_mask).any(Mask::has_heights)
    }

    /// True if walls of a mask are slanted, or its bars have several layers.
    pub fn has_walls(&self) -> bool {
        self.sample_mask.iter().chain(&self.detector_mask).any(Mask::has_walls)
    }

    /// Rotation centre to analyser, m: y of the analyser in the frame of the set-up.
    pub fn analyser_place(&self) -> f64 {
        self.analyser - self.rotation
    }

    /// Analyser to detector, m.
    pub fn gap(&self) -> f64 {
        self.detector.distance - self.analyser
    }

    /// Width of a pixel seen from the source in the plane of the analyser, m.
    pub fn analyser_pixel(&self) -> f64 {
        self.detector.pitch_at(0, self.analyser)
    }

    /// Number of mask steps.
    pub fn mask_steps(&self) -> usize {
        self.offsets.lists()[0].len()
    }

    /// Openings that make beamlets, in the plane of the cells, m: apertures of the sample mask, or pixels
    /// without it.
    pub fn beamlets(&self) -> Openings {
        match &self.sample_mask {
            Some(mask) => {
                mask.beamlets(self.cell_plane, self.detector.pitch_at(0, self.cell_plane))
            }
            None => Openings::side_by_side(self.detector.pitch_at(0, self.cell_plane)),
        }
    }

    /// Openings of the sample mask that light passes in the plane of the cells, m: a period contains all shifts.
    pub fn passed(&self) -> Option<Openings> {
        Some(self.sample_mask.as_ref()?.openings(self.cell_plane))
    }

    /// Windows that light passes on the analyser, m: openings of the detector mask, or pixels without
    /// it.
    pub fn windows(&self) -> Openings {
        match &self.detector_mask {
            Some(mask) => mask.windows(self.analyser),
            None => self.pixel_windows(),
        }
    }

    /// Columns that take the light, seen from the source in the plane of the analyser, m.
    fn pixel_windows(&self) -> Openings {
        Openings::side_by_side(self.analyser_pixel())
    }

    /// The same of whole pixels of the detector.
    pub fn whole_pixel_windows(&self) -> Openings {
        Openings::side_by_side(self.analyser_pixel() * f64::from(self.column_parts))
    }

    /// Widths of the apertures whose overlap is an illumination curve, m: of the sample mask as it
    /// is projected onto the analyser, of the detector mask in its own plane. 0 without the mask.
    pub fn overlapping_apertures(&self) -> [f64; 2] {
        let width = |mask: &Mask, plane: f64| mask.openings(plane).narrowest(0);
        [
            self.sample_mask.as_ref().map_or(0.0, |mask| width(mask, self.analyser)),
            self.detector_mask.as_ref().map_or(0.0, |mask| width(mask, mask.distance())),
        ]
    }

    /// Period of the sample mask in its own plane without its shifts, m: illumination curves repeat with it;
    /// infinite without a mask.
    pub fn curve_period(&self) -> f64 {
        let of = |mask: &Mask| mask.without_shifts(mask.distance()).period[0];
        self.sample_mask.as_ref().map_or(f64::INFINITY, of)
    }

    /// The same with its shifts: places of all slits repeat with it.
    pub fn pattern_period(&self) -> f64 {
        let of = |mask: &Mask| mask.openings(mask.distance()).period[0];
        self.sample_mask.as_ref().map_or(f64::INFINITY, of)
    }

    /// Source to where light is cut off for good, m: the detector mask, or the pixels.
    pub fn cutting_plane(&self) -> f64 {
        if self.detector_mask.is_some() { self.analyser } else { self.detector.distance }
    }

    /// Distance on the detector, in rows, that a source offset along z (or its deviation) moves
    /// the shadow of what lies at the rotation centre.
    pub fn rows_of_source(&self, offset: f64) -> f64 {
        let detector = &self.detector;
        offset * (detector.distance - self.rotation) / self.rotation / detector.pitch[1]
    }
}

/// Mask offsets of a scan less whole periods of the sample mask. The rest is exact.
fn view_offsets(scene: &Scene) -> ViewOffsets {
    let mask = scene.sample_mask.as_ref();
    let along_z = mask.and_then(MaskSpec::pattern_z).unwrap_or(f64::INFINITY);
    let patterns = [mask.map_or(f64::INFINITY, MaskSpec::pattern), along_z];
    ViewOffsets::new(&scene.scan, |exposure| scene.applied_offsets(exposure), patterns)
}

/// The focal spot, with a Gaussian blur of the detector added along z where no mask cuts light along z.
fn spot(scene: &Scene) -> Spot {
    let source = &scene.source;
    match &scene.detector.blur {
        Some(Blur::Gaussian { sigma }) if sigma[1] > 0.0 && !scene.has_heights() => {
            let gap = scene.detector.distance - source.distance;
            source.spot.blurred_along_z(sigma[1] / deviation(1.0) * source.distance / gap)
        }
        _ => source.spot.clone(),
    }
}
