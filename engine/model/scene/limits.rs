//! Upper limits of counts: far beyond any use, and low enough that a slip of a digit is an
//! error and not an allocation.

use beamlet_core::array_file::LONGEST_SIDE;

/// Greatest length, m: light years would do as well, but products of four lengths stay within f32.
pub(super) const LENGTH: f64 = 1e9;

/// True of a length that a scene may have.
pub(super) fn is_length(value: f64) -> bool {
    value.abs() <= LENGTH
}

/// Pixels per side of the detector.
pub const PIXELS: u32 = LONGEST_SIDE;
/// Bits of a detector's numbers: f32 holds whole numbers of 24 bits.
pub(super) const BIT_DEPTH: u32 = 24;
/// Standard deviation of a detector's blur, pixels.
pub(super) const BLUR: f64 = 100.0;
/// Rays per pixel and direction, and of a beamlet and row.
pub(super) const RAYS: u32 = 1_000_000;
/// Rays of a pixel under the scheme `random`. Each adds its light in units of 2^-32 of the open beam,
/// of which this many rays have some 10,000 each.
pub(super) const RAYS_OF_PIXEL: u64 = 400_000;
/// Apertures of a mask that a pixel sees: each is a window of light of its own.
pub(super) const APERTURES_PER_PIXEL: f64 = 1000.0;
/// Error that sampling may leave in a recorded value, share of open beam.
pub(super) const TOLERANCE: std::ops::RangeInclusive<f64> = 1e-6..=1e-2;
/// Gaussians, or points, of a focal spot.
pub(super) const SPOT_PARTS: u32 = 4096;
/// Energy nodes of a spectrum.
pub(super) const NODES: u32 = beamlet_interface::MOST_ENERGIES;
/// Mask offsets of a scan.
pub const MASK_OFFSETS: u32 = 100_000;
/// Mask offsets in periods of the sample mask: f64 holds the place of those within a period to 1e-6 of it.
pub(super) const OFFSET_PERIODS: f64 = 1e9;
/// Shadow of the bars at the edge of the detector over the narrowest bar or aperture, of apertures that end
/// along z: their corners are lit as if both directions were independent.
pub(super) const SHADOW_OF_HEIGHTS: f64 = 0.5;
/// Angles of a scan.
pub const ANGLES: u32 = 10_000_000;
/// Angles of a view of a fly scan.
pub(crate) const FLY: u32 = 1000;
/// Dithers of a scan.
pub(crate) const DITHERS: u32 = 1000;
/// Facets around a cylinder, cone, prism or wall of a tube.
pub(super) const SIDES: u32 = 1_000_000;
/// Facets around the equator of a sphere or ellipsoid, which has about half their square, or
/// around the ring of a torus, which has twice their square.
pub(super) const SPHERE_SIDES: u32 = 16_384;
/// Instances of an object.
pub const INSTANCES: u32 = 1_000_000;
/// Standard deviation of ln d of the diameters d of a packing: beyond it the largest would be more than
/// fifty times the smallest.
pub(super) const DIAMETER_SPREAD: f64 = 0.5;
/// Corners of an extruded polygon, whose edges are compared with one another.
pub(super) const CORNERS: u32 = 10_000;
/// Density of a material, g/cm3: more than four times the density of osmium.
pub(super) const DENSITY: f64 = 100.0;
/// FWHM of a spot before small detectors, m; otherwise the detector's larger side counts.
pub(super) const SPOT: f64 = 1e-3;
/// Standard deviation of the slopes of a rough surface: beyond it rays hit a surface several times, which
/// one normal does not describe.
pub(super) const ROUGHNESS: f64 = 0.3;
/// Variance of the refraction angle per length, rad2/m: a millimetre widens light to a tenth of a radian.
pub(super) const SCATTERING: f64 = 10.0;
/// Power of the energy that a variance is proportional to, at most.
pub(super) const SCATTERING_EXPONENT: f64 = 10.0;
/// Slits or rectangles of a period, and periods after which shifted apertures repeat.
pub(super) const SLITS: u32 = 1024;
/// Rows and columns of the pattern of a mask.
pub(super) const PATTERN: u32 = 2048;
/// Layers of the bars of a mask.
pub(super) const LAYERS: usize = 16;
/// Angle of the walls of bars to the optical axis, rad.
pub(super) const TAPER: f64 = std::f64::consts::FRAC_PI_4;
/// Bars of masks are thinner, m: thicker ones are probably a mistake.
pub const THICK_BARS: f64 = 1e-3;

/// Characters of a name.
pub(super) const NAME: usize = 200;
/// Characters of a title.
pub(super) const TITLE: usize = 200;
