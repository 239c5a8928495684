//! Residuals over iterations, on a logarithmic scale.

use super::axes::{Axes, BELOW, LEFT, roomy};
use super::colour::{SET, SMALL};
use super::drawing::{Anchor, Area, Drawing, INK, Paint};
use super::text::short;
use crate::residuals::Residuals;

/// Draws the residuals of a quantity; a disc marks the iteration that was taken.
pub(crate) fn draw(residuals: &Residuals, method: &str) -> Drawing {
    let Residuals { name, values, best } = residuals;
    let area = Area::new(LEFT + 14.0, 62.0, 560.0, 300.0);
    let mut drawing = Drawing::new(area.right() + 24.0, area.bottom() + BELOW + 8.0);
    let title = format!("Residuals of {name} by {method}");
    drawing.text([area.left, 28.0], title, 17.0, INK, Anchor::Start);
    let taken = values.get(*best).copied().unwrap_or(f64::NAN);
    let note = format!("iteration {best} is used: rms {}", short(taken));
    drawing.text([area.left, 50.0], note, SMALL, INK, Anchor::Start);
    let points: Vec<[f64; 2]> =
        values.iter().enumerate().map(|(n, value)| [n as f64, value.log10()]).collect();
    let last = values.len().saturating_sub(1).max(1) as f64;
    let y = roomy(points.iter().map(|point| point[1]));
    let axes = Axes { area, x: [0.0, last], y, ..Axes::default() };
    axes.grid(&mut drawing);
    let [colour, other, ..] = SET;
    axes.curve(&mut drawing, points.iter().copied(), Paint::line(colour, 1.6));
    axes.dots(&mut drawing, points.get(*best).copied().into_iter(), Paint::fill(other));
    axes.frame(&mut drawing, "iteration", "log₁₀ of the rms residual");
    drawing
}
