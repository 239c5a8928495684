//! Shape of the stacks of a scene, and the views of a run.

use crate::scene::{Exposure, Scene, limits};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// Every view of a run of `scene`: the flat, the dark frames where there are counts, then the
/// angles in order.
///
/// # Errors
/// As [`StackShape::of`].
pub fn views(scene: &Scene) -> Result<impl Iterator<Item = Exposure> + use<>> {
    let extent = StackShape::of(scene)?;
    let dark = scene.detector.counts.map(|_| Exposure::Dark);
    Ok([Some(Exposure::Flat), dark]
        .into_iter()
        .flatten()
        .chain((0..extent.views).map(Exposure::Sample)))
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

/// Shape of the stacks of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct StackShape {
    /// Views with the sample (the flat is one more).
    pub views: u32,
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
            steps: count("scan.mask_offsets", scene.scan.mask_offsets.len())?,
            rows: scene.detector.pixels[1],
            columns: scene.detector.pixels[0],
        };
        let Self { views, steps, rows, columns } = extent;
        let bytes = [views, steps, rows, columns].iter().map(|n| f64::from(*n)).product::<f64>();
        // Frames have four bytes a pixel, and there is the flat.
        if bytes > 2.0_f64.powi(60) {
            return Err(Error::scene(
                "scan",
                format!("{views} views of {steps} steps of {columns} x {rows} pixels"),
                "stacks of no more than 2^62 bytes",
            ));
        }
        Ok(extent)
    }

    /// Whether a scene may have this extent; the allowed extent, if not.
    pub(super) fn check(self) -> std::result::Result<(), String> {
        let sides = [
            ("views", self.views, limits::ANGLES),
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

    /// Bytes of all views, the flat included.
    #[must_use]
    pub fn total_bytes(&self) -> u64 {
        self.view_bytes() * (u64::from(self.views) + 1)
    }

    /// Bytes of all stacks of a run of `scene`: twice the intensities and the dark frames where
    /// there are counts.
    #[must_use]
    pub fn output_bytes(&self, scene: &Scene) -> u64 {
        match scene.detector.counts {
            Some(_) => 2 * self.total_bytes() + self.view_bytes(),
            None => self.total_bytes(),
        }
    }

    /// Whether a view lies within.
    pub(super) fn has(&self, view: Exposure) -> bool {
        !matches!(view, Exposure::Sample(index) if index >= self.views)
    }

    /// Every view with light: the flat, then the angles in order.
    pub fn all_views(&self) -> impl Iterator<Item = Exposure> + use<> {
        std::iter::once(Exposure::Flat).chain((0..self.views).map(Exposure::Sample))
    }
}
