//! retrieved.json: images, units, and meanings of flags.

use super::correct::ViewCorrection;
use super::diagnosis::EmptyBeam;
use super::mask_curve::MaskCurve;
use super::phase::Drift;
use super::response::Response;
use beamlet_core::{Error, Result, input_file};
use beamlet_files::FrameOrder;
use beamlet_files::layout::RECORD;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Contents of retrieved.json.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Record {
    /// Version of beamlet.
    pub version: String,
    /// Commit of its repository that it was built from; `None` in packages and incremental builds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub commit: Option<String>,
    /// When the retrieval began, and when its record was written: UTC, RFC 3339. `None` of images in memory.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub began: Option<String>,
    /// See `began`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub written: Option<String>,
    /// Seconds that the retrieval took by the clock on the wall.
    #[serde(default)]
    pub duration_s: f64,
    /// Command line; `None` where another program called the library.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command: Option<String>,
    /// Title of the scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// The method.
    pub method: String,
    /// Options that were given, by their names in Python, with their texts.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub options: BTreeMap<String, String>,
    /// Weights of the fit.
    pub weights: String,
    /// Background of the curves: `free`, `leak` or a value; `None` of methods without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub background: Option<String>,
    /// Small contrasts as the method finds them at these offsets, over the true ones; `None` where the curve of the masks
    /// is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub response: Option<Response>,
    /// Curve that was fitted, of method `exact-curve` over steps along x; `None` elsewhere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curve: Option<MaskCurve>,
    /// True if values were detector numbers, and not intensities.
    pub counts: bool,
    /// Variance of a value over its mean, where the values are counts.
    pub gain: Option<f64>,
    /// True if the gain is a guess.
    #[serde(default)]
    pub gain_assumed: bool,
    /// Standard deviation of a value's noise besides photon noise.
    #[serde(default)]
    pub read_noise: f64,
    /// Inputs: flat and sample.
    pub sources: Vec<String>,
    /// Files that were read as frames, in their order, of each folder of `sources` and `dark`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub frames: BTreeMap<String, Vec<String>>,
    /// Order of the frames of `sources`.
    #[serde(default, skip_serializing_if = "is_usual")]
    pub frame_order: FrameOrder,
    /// Frames without beam that were subtracted; `None` where there were none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dark: Option<String>,
    /// File of the pixels that were left out as bad; `None` where there was none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bad_pixels: Option<String>,
    /// Mask steps of the files that were left out, counted from 0; `offsets` has the others.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub omitted_steps: Vec<usize>,
    /// Columns that were kept of the frames, `START:END:STEP`; `None` where all were.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kept_columns: Option<String>,
    /// Columns and rows that were added to one pixel; `None` where none were.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bin: Option<[usize; 2]>,
    /// Neighbouring columns whose values are points of one curve, by the shifts of the masks; `None` without.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<usize>,
    /// Mask offsets at which the columns of a group sample their curve, m: for each offset one for each column.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub points: Vec<f64>,
    /// Place of each column of the images, as in geometry.json: x from the optical axis on the detector, m.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub columns_m: Vec<f64>,
    /// From pixel to pixel of the images on the detector, x and z, m.
    #[serde(default)]
    pub pitch: [f64; 2],
    /// The scene whose geometry the frames have, as TOML with absolute paths.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub geometry: Option<String>,
    /// SHA-256 of the inputs, by path: stacks, dark, geometry and lists of offsets; for a run its
    /// scene.toml and progress.log, which has the checksum of every view. The hash of a folder covers the
    /// lines `HASH  NAME` of its files, in the order of their names, as sha256sum prints them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub inputs: BTreeMap<String, String>,
    /// Hashes of sizes and times of modification of inputs, by path. An input is compared by its contents
    /// where its stamp differs, or it has none.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub input_stamps: BTreeMap<String, String>,
    /// Directory that relative paths of inputs start from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub working_directory: Option<String>,
    /// SHA-256 of the files that the scene of the geometry refers to, by their paths.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub files: BTreeMap<String, String>,
    /// Offsets of the sample mask, m.
    pub offsets: Vec<f64>,
    /// Offsets of the sample mask along z, m, one for each of `offsets`; empty without steps along z.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub offsets_z: Vec<f64>,
    /// Vectors of the lattice of beamlets as the flat has it, and the place of one beamlet from the middle of the
    /// detector, x and z, m; `None` without a lattice.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lattice_m: Option<[[f64; 2]; 3]>,
    /// Expected 1 sigma of each contrast in two directions where nothing is in the beam, median over the image, in
    /// the unit of its image; empty where values are no counts.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub expected_sigma: BTreeMap<String, f64>,
    /// Whole periods of the sample mask, m, that the offsets have more than the images
    /// `flat_centre` and `sample_centre`: 0 where the middle of the scan is within half a period of 0.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub whole_periods: f64,
    /// Median standard deviation of the flat's curves, m of offset (of beamlets m on the detector).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flat_width: Option<f64>,
    /// Median, over pixels and then views, of the residuals of the sample, rms: share of open beam, or
    /// counts; `None` for methods without residuals.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub residual: Option<f64>,
    /// Median, over pixels and then views, of the reduced chi squared of the fits of the sample, over the
    /// median of noise alone: 1 where values scatter as counts of this gain do. `None` where values are no
    /// counts or the method leaves nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reduced_chi_square: Option<f64>,
    /// The same beyond the residuals of the flat, which contain the misfit of the method's curve and the
    /// masks'.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chi_square_beyond_flat: Option<f64>,
    /// Pixels over all views whose transmission exceeds 1.01 by four of their deviations.
    #[serde(default)]
    pub above_one: u64,
    /// Values of flat and sample below zero, behind the dark.
    #[serde(default)]
    pub negative_values: u64,
    /// Pixels of an empty beam, and the results there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub empty_beam: Option<EmptyBeam>,
    /// Names of the corrections by empty beam; empty where nothing was corrected.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub correct: Vec<String>,
    /// Corrections of each view, in the order of the angles and of the dithers of each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub corrections: Vec<ViewCorrection>,
    /// Warnings about the data.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// Mask magnification M.
    pub magnification: f64,
    /// Lever arm z, m.
    pub lever_arm: f64,
    /// Refraction angle per shift of a centre, rad/m: -M/z, or 1/z for beamlets.
    pub angle_per_shift: f64,
    /// Views, rows and columns of the images.
    pub shape: [usize; 3],
    /// Pixel (or beamlet) and dither of each column in images of dithered views, from 0; empty without
    /// dithers. geometry.json has their places.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub columns: Vec<[usize; 2]>,
    /// Views between one flat and the next, where flats are interpolated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flats_every: Option<u32>,
    /// Mean angles of rows that were taken off before angles were integrated to the phase; `None` without
    /// its images.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drift: Option<Drift>,
    /// Unit of each image by its name.
    pub units: BTreeMap<String, String>,
    /// Meaning of each bit of `flags` by its value.
    pub flags: BTreeMap<u32, String>,
    /// Pixels with each bit over all views, by the bit's value.
    pub flagged: BTreeMap<u32, u64>,
    /// Pixels without a result over all views; their images hold NaN.
    pub without_answer: u64,
}

impl Record {
    /// Reads a retrieved.json.
    ///
    /// # Errors
    /// [`Error::File`] where it is missing or was not written by beamlet.
    pub fn read(path: &Path) -> Result<Self> {
        let text = input_file::text(path)
            .map_err(|error| Error::file(path, "cannot be read", Some(error)))?;
        serde_json::from_str(&text).map_err(|error| {
            Error::file(path, format!("is not the record of a retrieval: {error}"), None)
        })
    }

    /// The text of a retrieved.json.
    ///
    /// # Errors
    ///
    /// [`Error::File`] where a value has no form in JSON.
    pub(super) fn text(&self) -> Result<String> {
        let mut text = serde_json::to_string_pretty(self)
            .map_err(|error| Error::file(RECORD, format!("cannot be written: {error}"), None))?;
        text.push('\n');
        Ok(text)
    }
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde hands over a reference")]
const fn is_zero(length: &f64) -> bool {
    *length == 0.0
}

fn is_usual(order: &FrameOrder) -> bool {
    *order == FrameOrder::default()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Found by fuzzing: the last bit of some numbers was lost.
    #[test]
    fn numbers_are_read_as_they_were_written() {
        let lever_arm = 0.1 + 0.2;
        let record =
            Record { magnification: 1.522_222_222_222_222_1, lever_arm, ..Record::default() };
        let text = serde_json::to_string(&record).unwrap();
        assert_eq!(serde_json::from_str::<Record>(&text).unwrap(), record);
    }
}
