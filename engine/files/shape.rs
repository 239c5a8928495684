//! Shape of the stacks of a scene, and the views of a run.

use beamlet_core::{Error, Result, numbers};
use beamlet_model::scene::{Exposure, Scene, limits};
use serde::{Deserialize, Serialize};

/// Every view of a run of `scene` in the order of time: flats and, where there are counts, darks
/// before the views that follow them.
///
/// # Errors
/// As [`StackShape::of`].
pub fn views(scene: &Scene) -> Result<impl Iterator<Item = Exposure> + use<>> {
    let extent = StackShape::of(scene)?;
    let flats = scene.scan.flat_places();
    let darks = scene.detector.counts.map(|_| scene.scan.dark_places()).unwrap_or_default();
    let index = |places: &[u32], view: u32| places.binary_search(&view).ok().map(numbers::count);
    Ok((0..=extent.views).flat_map(move |view| {
        let flat = index(&flats, view).map(Exposure::Flat);
        let dark = index(&darks, view).map(Exposure::Dark);
        let sample = (view < extent.views).then_some(Exposure::Sample(view));
        [flat, dark, sample].into_iter().flatten()
    }))
}

/// Angles of the views of a scene, in order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ViewAngles {
    /// To a billionth of a degree.
    pub angles_deg: Vec<f64>,
    /// As the run takes them.
    pub angles_rad: Vec<f64>,
}

impl ViewAngles {
    /// Angles of the views of `scene`.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let scan = &scene.scan;
        let angles_rad: Vec<f64> = (0..scan.views()).map(|view| scan.angle_of(view)).collect();
        let degrees = angles_rad.iter().map(|angle| (angle.to_degrees() * 1e9).round() / 1e9);
        Self { angles_deg: degrees.collect(), angles_rad }
    }
}

const fn one() -> u32 {
    1
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde hands over a reference")]
const fn is_one(count: &u32) -> bool {
    *count == 1
}

/// Shape of the stacks of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct StackShape {
    /// Views with the sample.
    pub views: u32,
    /// Flats.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub flats: u32,
    /// Darks, where there are counts.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub darks: u32,
    /// Mask steps.
    pub steps: u32,
    /// Detector rows.
    pub rows: u32,
    /// Detector columns.
    pub columns: u32,
}

impl StackShape {
    /// Shape of the stacks of `scene`.
    ///
    /// # Errors
    /// [`Error::Scene`] where a list of the scan is longer than 2^32, or the stacks would have
    /// more bytes than 64 bits can count.
    pub fn of(scene: &Scene) -> Result<Self> {
        let count = |key: &str, n: usize| {
            u32::try_from(n)
                .map_err(|_| Error::scene(key, format!("{n} entries"), "fewer than 2^32"))
        };
        let extent = Self {
            views: count("scan.angles", scene.scan.views())?,
            flats: count("scan.flats_every", scene.scan.flat_places().len())?,
            darks: count("scan.darks_every", scene.scan.dark_places().len())?,
            steps: count("scan.mask_offsets", scene.scan.mask_offsets.len())?,
            rows: scene.detector.pixels[1],
            columns: scene.detector.pixels[0],
        };
        let Self { views, steps, rows, columns, .. } = extent;
        let bytes = [views, steps, rows, columns].iter().map(|n| f64::from(*n)).product::<f64>();
        // Frames have four bytes a pixel, and there are at most two flats for each view.
        if bytes > 2.0_f64.powi(60) {
            return Err(Error::scene(
                "scan",
                format!("{views} views of {steps} steps of {columns} x {rows} pixels"),
                "stacks of no more than 2^62 bytes",
            ));
        }
        Ok(extent)
    }

    /// Checks that a scene may have this extent.
    ///
    /// # Errors
    ///
    /// The allowed extent.
    pub(super) fn check(self) -> std::result::Result<(), String> {
        let sides = [
            ("views", self.views, limits::ANGLES),
            ("flats", self.flats, limits::ANGLES + 1),
            ("darks", self.darks, limits::ANGLES + 1),
            ("steps", self.steps, limits::MASK_OFFSETS),
            ("rows", self.rows, limits::PIXELS),
            ("columns", self.columns, limits::PIXELS),
        ];
        match sides.into_iter().find(|(_, found, most)| !(1..=*most).contains(found)) {
            Some((side, found, most)) => Err(format!("{found} {side}; allowed: 1 to {most}")),
            None => Ok(()),
        }
    }

    /// Bytes of one frame.
    #[must_use]
    pub fn frame_bytes(&self) -> u64 {
        4 * u64::from(self.rows) * u64::from(self.columns)
    }

    /// Bytes of one view with all its steps.
    #[must_use]
    pub fn view_bytes(&self) -> u64 {
        self.frame_bytes() * u64::from(self.steps)
    }

    /// Bytes of all views, the flats included.
    #[must_use]
    pub fn total_bytes(&self) -> u64 {
        self.view_bytes() * (u64::from(self.views) + u64::from(self.flats))
    }

    /// Bytes of all stacks of a run of `scene`: twice the intensities and the dark frames where
    /// there are counts.
    #[must_use]
    pub fn output_bytes(&self, scene: &Scene) -> u64 {
        match scene.detector.counts {
            Some(_) => 2 * self.total_bytes() + u64::from(self.darks) * self.view_bytes(),
            None => self.total_bytes(),
        }
    }

    /// True if a view lies within.
    pub(super) fn has(&self, view: Exposure) -> bool {
        view.index() < self.count_of(view)
    }

    /// Number of exposures of the stack of a view.
    pub(super) const fn count_of(&self, view: Exposure) -> u32 {
        match view {
            Exposure::Flat(_) => self.flats,
            Exposure::Dark(_) => self.darks,
            Exposure::Sample(_) => self.views,
        }
    }

    /// Every view with light: the flats, then the angles in order.
    pub fn all_views(&self) -> impl Iterator<Item = Exposure> + use<> {
        (0..self.flats).map(Exposure::Flat).chain((0..self.views).map(Exposure::Sample))
    }
}
