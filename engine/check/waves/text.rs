//! Limits of ray optics as lines of text.

use super::{FlatLimits, ObjectLimits, RayLimits};
use crate::check::display::length;
use beamlet_core::printed::number;

/// Objects of a list.
const LISTED: usize = 12;

impl RayLimits {
    /// Lines for a terminal or a page: a label each, and a text.
    #[must_use]
    pub fn lines(&self) -> Vec<(String, String)> {
        let mut lines = Vec::new();
        if let Some(criteria) = &self.criteria {
            let text = format!(
                "{} of the aperture; blur of the spot over fringes {}",
                number(rounded(criteria.fresnel_number)),
                number(rounded(criteria.blur_over_fringe))
            );
            lines.push(("Fresnel number".into(), text));
            let [shear, width] = [criteria.shear, criteria.curve_width].map(short_length);
            lines.push(("shear".into(), format!("{shear}, of a curve of {width}")));
        }
        lines.push(("flat".into(), self.flat_text()));
        for object in self.objects.iter().take(LISTED) {
            lines.push((object.name.clone(), object.text()));
        }
        let rough: Vec<&str> =
            self.objects.iter().filter(|it| it.rough).map(|it| it.name.as_str()).collect();
        if !rough.is_empty() {
            let text = format!(
                "slopes without a length by rays: the error of its dark field is unknown ({})",
                rough.join(", ")
            );
            lines.push(("roughness".into(), text));
        }
        if let Some(more) = self.objects.len().checked_sub(LISTED).filter(|more| *more > 0) {
            lines.push((String::new(), format!("{more} more objects: see `beamlet check --json`")));
        }
        lines
    }

    fn flat_text(&self) -> String {
        if let Some(reason) = &self.unknown_flat {
            return format!("error unknown: {reason}");
        }
        let Some(flat) = &self.flat else {
            return "even without a sample mask, by waves and by rays".into();
        };
        let [offset, _, error] = flat.worst();
        let bars = match flat.bars > 1e-6 {
            true => format!(", and {:.1e} by the phase of the bars", flat.bars),
            false => String::new(),
        };
        format!(
            "waves less rays {error:.1e} of open beam, {} of the peak, at {}{bars}",
            percent(flat.relative),
            length(offset)
        )
    }
}

impl FlatLimits {
    /// The step that errs most: mask offset (m), light by rays, light by waves less light by rays.
    pub(super) fn worst(&self) -> [f64; 3] {
        let largest = |a: &&[f64; 3], b: &&[f64; 3]| a[2].abs().total_cmp(&b[2].abs());
        self.steps.iter().max_by(largest).copied().unwrap_or_default()
    }
}

impl ObjectLimits {
    fn text(&self) -> String {
        let mut parts = Vec::new();
        if let Some(range) = self.diameters {
            let what = if self.round { "diameter" } else { "between cylinders of" };
            parts.push(format!("{what} {}", lengths(range)));
        }
        if let Some(range) = self.dark_field {
            parts.push(format!("dark field by waves {} of rays", ratios(range)));
        }
        parts.extend(self.unknown.iter().cloned());
        parts.join("; ")
    }
}

/// A number rounded to three digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

/// A length with three digits.
pub(super) fn short_length(metres: f64) -> String {
    length(rounded(metres))
}

/// A share as per cent with two digits.
pub(super) fn percent(share: f64) -> String {
    let two = format!("{:.1e}", 100.0 * share).parse().unwrap_or(100.0 * share);
    format!("{} %", number(two))
}

/// One ratio or two with two digits.
pub(super) fn ratios([low, high]: [f64; 2]) -> String {
    let [a, b] = [low, high].map(|ratio| format!("{ratio:.2}"));
    if a == b { a } else { format!("{a} to {b}") }
}

/// One length or two, with three digits.
pub(super) fn lengths([low, high]: [f64; 2]) -> String {
    let [a, b] = [low, high].map(short_length);
    if a == b { a } else { format!("{a} to {b}") }
}
