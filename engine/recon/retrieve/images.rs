//! Curves of flat and sample to transmission, refraction and dark field (design 6.1), with their
//! uncertainties.

use super::curves::Curve;
use super::flags;
use beamlet_core::array_file::Sample;
use beamlet_core::numbers::single;
use ndarray::Array2;
use std::ops::Range;

/// Images of the contrasts, and of their uncertainties.
pub(super) const CONTRASTS: [&str; 6] =
    ["transmission", "refraction", "refraction_z", "dark_field", "dark_field_z", "dark_field_xz"];
const SIGMAS: [&str; 6] = [
    "transmission_sigma",
    "refraction_sigma",
    "refraction_z_sigma",
    "dark_field_sigma",
    "dark_field_z_sigma",
    "dark_field_xz_sigma",
];
/// Images of the curves of the flat: one for all views where these have one flat. The last three are the standard
/// deviations of the area as a share of it, of the centre and of the width.
const OF_FLAT: [&str; 11] = [
    "flat_amplitude",
    "flat_centre",
    "flat_centre_z",
    "flat_width",
    "flat_width_z",
    "flat_covariance_xz",
    "flat_background",
    "residual_flat",
    "flat_area_sigma",
    "flat_centre_sigma",
    "flat_width_sigma",
];
/// Images of the curves of the sample.
const OF_SAMPLE: [&str; 8] = [
    "sample_amplitude",
    "sample_centre",
    "sample_centre_z",
    "sample_width",
    "sample_width_z",
    "sample_covariance_xz",
    "sample_background",
    "residual_sample",
];
/// Image of the flags of pixels, whose values are whole numbers.
pub(crate) const FLAGS: &str = "flags";
/// Image of the integral of δ along the beam.
pub(super) const PHASE: &str = "phase";

/// Names of the images of the flat and of a view that are given.
pub(super) fn names(is_given: impl Fn(&str) -> bool) -> [Vec<&'static str>; 2] {
    let of_view = CONTRASTS.into_iter().chain(SIGMAS).chain([FLAGS]).chain(OF_SAMPLE);
    let given = |name: &&'static str| is_given(name);
    [OF_FLAT.into_iter().filter(given).collect(), of_view.filter(given).collect()]
}

/// True for images of a second direction, which slits do not have.
pub(super) fn is_of_z(name: &str) -> bool {
    ["_z", "_xz"].iter().any(|end| name.trim_end_matches("_sigma").ends_with(end))
}

/// Unit of an image. `value`: what intensities are counted in.
pub(super) fn unit<'a>(name: &str, value: &'a str) -> &'a str {
    match name {
        "transmission" | "transmission_sigma" | "flat_area_sigma" => "1",
        name if name.starts_with("refraction") => "rad",
        name if name.starts_with("dark_field") => "rad^2",
        FLAGS => "bits",
        PHASE => "m",
        "flat_centre_sigma" | "flat_width_sigma" => "m",
        name if name.ends_with("_covariance_xz") => "m^2",
        name if ["_centre", "_centre_z", "_width", "_width_z"]
            .iter()
            .any(|end| name.ends_with(end)) =>
        {
            "m"
        }
        _ => value,
    }
}

/// Type of the values of an image in a file.
pub(super) fn sample(name: &str) -> Sample {
    if name == FLAGS { Sample::U32 } else { Sample::F32 }
}

/// The images of one view, `[row][column]`, by name.
#[derive(Debug, Clone)]
pub struct Images {
    names: Vec<&'static str>,
    maps: Vec<Array2<f32>>,
}

impl Images {
    /// Images of `rows` rows of `columns`, all unknown.
    pub(super) fn new(names: Vec<&'static str>, rows: usize, columns: usize) -> Self {
        let maps = names.iter().map(|_| Array2::from_elem((rows, columns), f32::NAN)).collect();
        Self { names, maps }
    }

    /// Names of the images.
    pub(super) fn names(&self) -> &[&'static str] {
        &self.names
    }

    /// Rows of each image.
    pub(super) fn rows(&self) -> usize {
        self.maps.first().map_or(0, Array2::nrows)
    }

    /// Takes a column of other images of the same names.
    pub(super) fn copy_column(&mut self, at: usize, from: &Self, column: usize) {
        for (map, other) in self.maps.iter_mut().zip(&from.maps) {
            map.column_mut(at).assign(&other.column(column));
        }
    }

    /// Names and images.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, &Array2<f32>)> {
        self.names.iter().copied().zip(&self.maps)
    }

    /// An image; `None` if the method does not give it. In images, 1-sigma uncertainties have the unit of
    /// their image: transmission 1, refraction rad, dark field rad^2; centres and widths are in m.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&Array2<f32>> {
        self.iter().find(|(other, _)| *other == name).map(|(_, map)| map)
    }

    /// An image to change.
    pub(super) fn get_mut(&mut self, name: &str) -> Option<&mut Array2<f32>> {
        let at = self.names.iter().position(|other| *other == name)?;
        self.maps.get_mut(at)
    }

    /// Fills the pixels `at` of the images of a view from their curves of flat and sample; `None` for places without
    /// curves, which have no flag.
    pub(super) fn take(
        &mut self,
        at: Range<usize>,
        curves: impl Fn(usize) -> [Option<Curve>; 2],
        angle_per_shift: f64,
    ) {
        let all = || CONTRASTS.into_iter().chain(SIGMAS).chain(OF_SAMPLE).chain([FLAGS]);
        self.fill(at, all(), |pixel| {
            let [flat, sample] = curves(pixel);
            let mut values = [f64::NAN; 21];
            if let Some(sample) = sample.filter(Curve::has_answer) {
                if let Some(flat) = flat.filter(Curve::has_answer) {
                    values[..12].copy_from_slice(&contrasts(&flat, &sample, angle_per_shift));
                }
                values[12..20].copy_from_slice(&of_curve(&sample)[..8]);
            }
            let bits = |curve: Option<Curve>| curve.map_or(0, |curve| curve.flags);
            let of_flat = bits(flat.filter(|_| sample.is_some()));
            values[20] = f64::from(flags::of_pixel(of_flat, bits(sample)));
            values
        });
    }

    /// Fills the images of the flat from its curves.
    pub(super) fn take_flat(&mut self, curves: impl Fn(usize) -> Option<Curve>) {
        let count = self.maps.first().map_or(0, Array2::len);
        self.fill(0..count, OF_FLAT.into_iter(), |pixel| {
            let known = curves(pixel).filter(Curve::has_answer);
            known.map_or([f64::NAN; 11], |curve| of_curve(&curve))
        });
    }

    /// Fills pixels with values by the names of their images.
    fn fill<const N: usize>(
        &mut self,
        at: Range<usize>,
        names: impl Iterator<Item = &'static str> + Clone,
        values: impl Fn(usize) -> [f64; N],
    ) {
        let place = |name: &&str| names.clone().position(|other| other == *name);
        let places: Vec<Option<usize>> = self.names.iter().map(place).collect();
        let mut maps: Vec<(&mut [f32], usize)> = self
            .maps
            .iter_mut()
            .zip(places)
            .filter_map(|(map, place)| map.as_slice_mut().zip(place))
            .collect();
        for pixel in at {
            let values = values(pixel);
            maps.iter_mut().for_each(|(map, place)| map[pixel] = single(values[*place]));
        }
    }
}

/// Values of a curve in the order of the images of the flat.
fn of_curve(curve: &Curve) -> [f64; 11] {
    let [xx, zz, xz] = curve.moments;
    [
        curve.amplitude,
        curve.centre_of(0),
        curve.centre_of(1),
        xx.sqrt(),
        zz.sqrt(),
        xz,
        curve.background,
        curve.residual,
        curve.area_sigma,
        curve.centre_sigma[0],
        curve.width_sigma(),
    ]
}

/// Contrasts and their uncertainties: of the area, the centre, and the second moments. `angle_per_shift`: refraction
/// angle per shift of the centre, -M/z for a scan of the sample mask.
pub(super) fn contrasts(f: &Curve, s: &Curve, angle_per_shift: f64) -> [f64; 12] {
    let square = angle_per_shift * angle_per_shift;
    let transmission = s.area / f.area;
    let angle = |axis: usize| angle_per_shift * (s.centre_of(axis) - f.centre_of(axis));
    let angle_sigma =
        |axis: usize| angle_per_shift.abs() * f.centre_sigma[axis].hypot(s.centre_sigma[axis]);
    // An unresolved flat has the moments of the geometry.
    let by = |k: usize| if s.resolves(k) { square } else { f64::NAN };
    let dark = |k: usize| by(k) * (s.moments[k] - f.moments[k]);
    let dark_sigma = |k: usize| by(k) * f.moments_sigma[k].hypot(s.moments_sigma[k]);
    [
        transmission,
        angle(0),
        angle(1),
        dark(0),
        dark(1),
        dark(2),
        transmission * f.area_sigma.hypot(s.area_sigma),
        angle_sigma(0),
        angle_sigma(1),
        dark_sigma(0),
        dark_sigma(1),
        dark_sigma(2),
    ]
}
