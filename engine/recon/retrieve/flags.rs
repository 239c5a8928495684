//! Meanings of the bits of a flag image. A curve has ten bits; in the image the flat's come first and the
//! sample's follow, then the bits of the pixel, so that every value is an integer that f32 holds exactly.

use beamlet_interface as interface;

/// All values are the same, or none is above another: a dead pixel, or no light.
pub const DEAD: u32 = interface::CURVE_DEAD;
/// A value is not a number or infinite.
pub const NOT_FINITE: u32 = interface::CURVE_NOT_FINITE;
/// Values at or above the saturation were left out.
pub const SATURATED: u32 = interface::CURVE_SATURATED;
/// Fewer values are left than the method needs.
pub const FEW: u32 = interface::CURVE_FEW;
/// The fit did not settle.
pub const NOT_CONVERGED: u32 = interface::CURVE_NOT_CONVERGED;
/// The condition number of the normal equations (unit diagonal) passes 100.
pub const ILL_CONDITIONED: u32 = interface::CURVE_ILL_CONDITIONED;
/// The offsets do not resolve the width: it is below a third of their least distance, or above the scan.
pub const WIDTH: u32 = interface::CURVE_WIDTH;
/// The centre lies outside the scan: extrapolated.
pub const OUTSIDE: u32 = interface::CURVE_OUTSIDE;
/// No peak: its amplitude is not above three times its own uncertainty.
pub const NO_PEAK: u32 = interface::CURVE_NO_PEAK;
/// The curve does not fall off within the scan (moments).
pub const TRUNCATED: u32 = 512;

/// The contrasts leave the lines through the neighbours on both sides, as at a silhouette. A bit of a pixel, and not of
/// one of its curves.
pub const MISFIT: u32 = 1 << 20;
/// The pixels do not determine the width of a beamlet of the flat, which is that of the geometry
/// then, or of the sample, whose dark field is NaN (`beamlet`). The refraction is NaN where they do
/// not determine its centre. A bit of a pixel.
pub const UNRESOLVED: u32 = 1 << 21;
/// Another curve of the masks may be the right one: another solution fits as well, and there are no uncertainties; a
/// whole period may be missing from the angle; or no solution explains the values. A bit of a pixel.
pub const DOUBTFUL: u32 = 1 << 23;
/// A pixel that is named as bad, or a beamlet of such pixels: it has no result. A bit of a pixel, alone.
pub const BAD_PIXEL: u32 = 1 << 22;

/// Bits of a curve: the sample's bits in an image are the flat's, shifted by this.
pub const BITS: u32 = 10;

/// With one of these a pixel has no result, and its images hold NaN.
pub const NO_ANSWER: u32 = DEAD | NOT_FINITE | FEW | NOT_CONVERGED | WIDTH | NO_PEAK;

/// Each bit of a pixel with its name and meaning.
pub const OF_PIXEL: [(u32, &str, &str); 4] = [
    (MISFIT, "misfit", "the contrasts do not continue those of the neighbours"),
    (
        UNRESOLVED,
        "unresolved",
        "pixels too wide, or counts too few, to determine the width of the beamlet",
    ),
    (BAD_PIXEL, "bad_pixel", "excluded as a bad pixel (--bad-pixels)"),
    (
        DOUBTFUL,
        "doubtful",
        "another curve of the masks may be the right one: another solution fits as well (uncertainties are NaN), the angle may be a period of the sample mask off, or residuals exceed the noise and the error of the curve",
    ),
];

/// Each bit of a curve with its name and meaning, for files and tables.
pub const MEANINGS: [(u32, &str, &str); 10] = [
    (DEAD, "dead", "all values are the same: dead pixel, or no light"),
    (NOT_FINITE, "not_finite", "a value is not a number or infinite"),
    (SATURATED, "saturated", "values at or above the saturation were left out"),
    (FEW, "few", "too few values remain for the method"),
    (NOT_CONVERGED, "not_converged", "the fit did not converge"),
    (
        ILL_CONDITIONED,
        "ill_conditioned",
        "the condition number of the normal equations exceeds 100",
    ),
    (WIDTH, "width", "the offsets cannot resolve the width"),
    (OUTSIDE, "outside", "the centre lies outside the scan"),
    (NO_PEAK, "no_peak", "the amplitude is not above three times its own uncertainty"),
    (
        TRUNCATED,
        "truncated",
        "the curve does not fall off within the scan, or the steps miss its slopes",
    ),
];

/// Bits of an image's pixel, from the bits of its two curves.
#[must_use]
pub const fn of_pixel(flat: u32, sample: u32) -> u32 {
    let of_curve = (1 << BITS) - 1;
    (flat & of_curve) | (sample & of_curve) << BITS | ((flat | sample) & (UNRESOLVED | DOUBTFUL))
}
