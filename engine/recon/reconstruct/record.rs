//! volume.json: quantities and provenance of volumes, and the grid of their voxels.

use super::geometry::ScanGeometry;
use super::grid::VolumeGrid;
use super::hardening::BeamEnergy;
use super::lost_record::MomentRecord;
use super::plan::VolumePlan;
use super::prepare::PixelCounts;
use super::voxel_mask::VoxelMask;
use super::write::VolumeFormat;
use crate::retrieve::Drift;
use beamlet_core::{Error, Result, input_file};
use beamlet_files::layout::VOLUME;
use beamlet_files::working_directory;
use beamlet_gpu::Compute;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Contents of volume.json.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct VolumeRecord {
    /// Version of beamlet.
    pub version: String,
    /// Commit of its repository that it was built from; `None` in packages and incremental builds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub commit: Option<String>,
    /// When the reconstruction began: UTC, RFC 3339.
    pub began: String,
    /// When the record was written.
    pub written: String,
    /// Seconds that the reconstruction took by the clock on the wall.
    pub duration_s: f64,
    /// Command line; `None` where another program called the library.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command: Option<String>,
    /// Device name.
    pub device: String,
    /// Driver name and version.
    pub driver: String,
    /// Method.
    pub method: String,
    /// Its options.
    pub options: serde_json::Value,
    /// SHA-256 of the inputs, by path, as in retrieved.json, and those of the retrieved.json of the images.
    pub inputs: BTreeMap<String, String>,
    /// Hashes of sizes and times of modification of inputs, by path. An input is compared by its contents
    /// where its stamp differs, or it has none.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub input_stamps: BTreeMap<String, String>,
    /// Directory that relative paths of inputs start from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub working_directory: Option<String>,
    /// Views, rows and columns of the sinograms.
    pub sinograms: [usize; 3],
    /// Column of the axis of rotation among these columns, counted from 0.
    pub axis_column: f64,
    /// Stripes of single columns were taken off.
    #[serde(default)]
    pub rings: bool,
    /// Moments of the refraction of the views, and views that lost them; `None` without a volume of δ.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refraction_moment: Option<MomentRecord>,
    /// Length k with which kμ was added to δ, m; `None` where it was not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gradient_bias_m: Option<f64>,
    /// Energy of the beam; `None` where the scene is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beam: Option<BeamEnergy>,
    /// Correction of beam hardening; `None` where there was none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beam_hardening: Option<HardeningRecord>,
    /// Voxels that may differ from zero: a shape (lengths in m) or a file; `None`: all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mask: Option<String>,
    /// Folder of the volumes that iterations began with; `None`: zero.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<String>,
    /// Mean angles of rows that were taken off before angles were integrated; `None` where they were not
    /// integrated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drift: Option<Drift>,
    /// Pixels of the sinograms by quantity.
    pub pixels: BTreeMap<String, PixelCounts>,
    /// File format of the volumes.
    pub format: VolumeFormat,
    /// Order of the sides of the arrays.
    pub order: String,
    /// Directions of the sides.
    pub axes: String,
    /// Voxels along x, y, z.
    pub size: [usize; 3],
    /// Side of a voxel along x, y, z, m.
    pub voxel_m: [f64; 3],
    /// Centre of voxel (0, 0, 0) from the axis of rotation and the optical axis, m.
    pub origin_m: [f64; 3],
    /// Unit of each volume by its name.
    pub units: BTreeMap<String, String>,
    /// Object and material of each label of the truth; empty without one.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub labels: BTreeMap<u32, String>,
    /// Files beside the volumes.
    pub files: Vec<String>,
}

/// Correction of beam hardening as volume.json has it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct HardeningRecord {
    /// Material that −ln T was taken for.
    pub material: String,
    /// Energy that μ is quoted at, keV.
    pub energy_kev: f64,
    /// Factors of the first power of −ln T and those above.
    pub coefficients: Vec<f64>,
    /// Largest −ln T that the polynomial is fitted to; it goes on straight beyond.
    pub largest: f64,
    /// Largest error of the fit, a share of −ln T.
    pub error: f64,
}

impl VolumeRecord {
    /// The record of a reconstruction that begins.
    pub(super) fn begin(
        compute: &Compute,
        geometry: &ScanGeometry,
        plan: &VolumePlan,
        format: VolumeFormat,
    ) -> Self {
        let about = compute.description();
        Self {
            version: beamlet_core::program::VERSION.to_owned(),
            commit: beamlet_core::program::commit(),
            began: beamlet_files::now(),
            written: String::new(),
            duration_s: 0.0,
            command: None,
            device: about.name.clone(),
            driver: about.driver.clone(),
            method: plan.method.name().to_owned(),
            options: plan.method.options(),
            inputs: BTreeMap::new(),
            input_stamps: BTreeMap::new(),
            working_directory: working_directory(),
            sinograms: geometry.shape(),
            axis_column: geometry.axis_column(),
            rings: plan.rings,
            refraction_moment: None,
            gradient_bias_m: None,
            beam: plan.beam,
            beam_hardening: None,
            mask: plan.mask.as_ref().map(VoxelMask::words),
            start: plan.start.as_ref().map(|path| path.display().to_string()),
            drift: None,
            pixels: BTreeMap::new(),
            format,
            order: "[z][y][x]".to_owned(),
            axes: "x, y and z of the scene, each ascending; x = y = 0 on the axis of rotation, z = 0 on \
                   the optical axis"
                .to_owned(),
            size: plan.grid.size,
            voxel_m: plan.grid.voxel,
            origin_m: plan.grid.origin,
            units: BTreeMap::new(),
            labels: BTreeMap::new(),
            files: Vec::new(),
        }
    }

    /// Reads the volume.json of a folder.
    ///
    /// # Errors
    /// [`Error::File`] where it is missing or was not written by beamlet.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(VOLUME);
        let text = input_file::text(&path)
            .map_err(|error| Error::file(&path, "cannot be read", Some(error)))?;
        serde_json::from_str(&text).map_err(|error| {
            Error::file(&path, format!("is not the record of a reconstruction: {error}"), None)
        })
    }

    /// Where the voxels lie.
    #[must_use]
    pub const fn grid(&self) -> VolumeGrid {
        VolumeGrid { size: self.size, voxel: self.voxel_m, origin: self.origin_m }
    }

    /// The metadata of every image of a volume.
    pub(super) fn about(&self) -> serde_json::Value {
        serde_json::json!({
            "beamlet": self.version,
            "method": self.method,
            "order": self.order,
            "voxel_m": self.voxel_m,
            "origin_m": self.origin_m,
        })
    }

    /// The record as JSON.
    ///
    /// # Errors
    ///
    /// [`beamlet_core::Error::File`] where a value cannot be written.
    pub(super) fn text(&self) -> Result<String> {
        let mut text = serde_json::to_string_pretty(self)
            .map_err(|error| Error::file(VOLUME, format!("cannot be written: {error}"), None))?;
        text.push('\n');
        Ok(text)
    }
}
