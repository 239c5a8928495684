//! Comparison of the refraction moments of views, as volume.json has it.

use beamlet_core::printed::number;
use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// Views that a text names.
const NAMED: usize = 8;

/// Use of lost views in δ.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum LostUse {
    /// No weight: rows are interpolated between the views on both sides (filtered back-projection).
    Interpolated,
    /// No weight (iterative methods).
    ZeroWeight,
    /// Full weight.
    Kept,
}

/// A view that lost its refraction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LostView {
    /// Number of the view.
    pub view: usize,
    /// Its angle, degrees.
    pub angle_deg: f64,
    /// Number of rows that lost it.
    pub rows: usize,
    /// Moment that is left over the expected one, mean over these rows.
    pub left: f64,
}

/// Comparison of the moments of the views, as volume.json has it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct MomentRecord {
    /// Standard deviation of the moment of a view and row by noise and sampling, over the moment: the median of
    /// the rows that have one. `None` without a comparison.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<f64>,
    /// Least loss that counts, over the moment, in a row with this noise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limit: Option<f64>,
    /// Reason why views are not compared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub not_compared: Option<String>,
    /// Use of the lost views; `None` where no view is lost.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lost_views_are: Option<LostUse>,
    /// Lost views.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lost_views: Vec<LostView>,
}

impl MomentRecord {
    /// Lost views in words.
    #[must_use]
    pub fn words(&self) -> String {
        let views = &self.lost_views;
        let mut text = format!("{} view{} (", views.len(), if views.len() == 1 { "" } else { "s" });
        for (n, lost) in views.iter().take(NAMED).enumerate() {
            let separator = if n == 0 { "" } else { ", " };
            let _ = write!(text, "{separator}{} at {} deg", lost.view, number(lost.angle_deg));
        }
        text.push_str(if views.len() > NAMED { ", …)" } else { ")" });
        text
    }
}
