//! Curves of flat and sample to transmission, refraction and dark field (design 6.1), with their
//! uncertainties.

use super::curves::Curves;
use super::flags;
use beamlet_core::array_file::Sample;
use beamlet_core::numbers::single;
use ndarray::Array2;
use std::ops::Range;

/// Images of the contrasts, in the order in which they are written.
pub(super) const CONTRASTS: [&str; 6] = [
    "transmission",
    "refraction",
    "dark_field",
    "transmission_sigma",
    "refraction_sigma",
    "dark_field_sigma",
];
/// Images of the flat's curves: one for all views.
pub(super) const OF_FLAT: [&str; 5] =
    ["flat_amplitude", "flat_centre", "flat_width", "flat_background", "residual_flat"];
/// Standard deviations of the flat's curves, where values are counts: of the area as a share of it, of the
/// centre and of the width.
pub(super) const SIGMAS_OF_FLAT: [&str; 3] =
    ["flat_area_sigma", "flat_centre_sigma", "flat_width_sigma"];
/// Images of the sample's curves.
pub(super) const OF_SAMPLE: [&str; 5] =
    ["sample_amplitude", "sample_centre", "sample_width", "sample_background", "residual_sample"];
/// Image of the flags of pixels, whose values are whole numbers.
pub(crate) const FLAGS: &str = "flags";
/// Image of the integral of δ along the beam.
pub(super) const PHASE: &str = "phase";

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

    /// Images of one shape by their names.
    pub(super) fn of(images: Vec<(&'static str, Array2<f32>)>) -> Self {
        let (names, maps) = images.into_iter().unzip();
        Self { names, maps }
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

    /// Fills the pixels `at` from the curves of the whole flat and of these pixels' sample.
    pub(super) fn take(
        &mut self,
        at: Range<usize>,
        flat: &Curves,
        sample: &Curves,
        angle_per_shift: f64,
    ) {
        let find = |name: &str| self.names.iter().position(|other| *other == name);
        let of_flags = find(FLAGS);
        let of_sample = OF_SAMPLE.map(find);
        let of_contrasts = CONTRASTS.map(find);
        let mut put = |map: Option<usize>, pixel: usize, value: f32| {
            if let Some(values) = map.and_then(|map| self.maps[map].as_slice_mut()) {
                values[pixel] = value;
            }
        };
        for (s, pixel) in at.enumerate() {
            let bits = flags::of_pixel(flat.flags[pixel], sample.flags[s]);
            put(of_flags, pixel, single(f64::from(bits)));
            if !sample.has_answer(s) {
                continue;
            }
            let curve = [
                sample.amplitude[s],
                sample.centre[s],
                sample.width[s],
                sample.background[s],
                sample.residual[s],
            ];
            for (map, value) in of_sample.into_iter().zip(curve) {
                put(map, pixel, value);
            }
            if flat.has_answer(pixel) {
                let values = contrasts(flat, pixel, sample, s, angle_per_shift);
                for (map, value) in of_contrasts.into_iter().zip(values) {
                    put(map, pixel, single(value));
                }
            }
        }
    }
}

/// Contrasts and their uncertainties, in the order of [`CONTRASTS`]. `angle_per_shift`: refraction angle per
/// shift of the centre, -M/z for a scan of the sample mask.
fn contrasts(flat: &Curves, f: usize, sample: &Curves, s: usize, angle_per_shift: f64) -> [f64; 6] {
    let pair = |of: fn(&Curves) -> &Vec<f32>| [f64::from(of(flat)[f]), f64::from(of(sample)[s])];
    let [area_f, area_s] = pair(|c| &c.area);
    let [centre_f, centre_s] = pair(|c| &c.centre);
    let [width_f, width_s] = pair(|c| &c.width);
    let [area_sigma_f, area_sigma_s] = pair(|c| &c.area_sigma);
    let [centre_sigma_f, centre_sigma_s] = pair(|c| &c.centre_sigma);
    let [width_sigma_f, width_sigma_s] = pair(|c| &c.width_sigma);
    let transmission = area_s / area_f;
    // An unresolved flat has the width of the geometry.
    let resolved = sample.flags[s] & flags::UNRESOLVED == 0;
    let by_width = if resolved { angle_per_shift * angle_per_shift } else { f64::NAN };
    [
        transmission,
        angle_per_shift * (centre_s - centre_f),
        by_width * (width_s - width_f) * (width_s + width_f),
        transmission * area_sigma_f.hypot(area_sigma_s),
        angle_per_shift.abs() * centre_sigma_f.hypot(centre_sigma_s),
        2.0 * by_width * (width_f * width_sigma_f).hypot(width_s * width_sigma_s),
    ]
}
