//! The illumination curve of a pixel: flat and sample, with their fits and what these leave.

use super::axes::{Axes, BELOW, LEFT, roomy};
use super::colour::{Rgb, SET, SMALL};
use super::drawing::{Anchor, Area, Drawing, GREY, INK, Paint};
use super::text::{cut, wrapped};
use beamlet::retrieve::MaskCurve;

/// A fitted curve: `A exp(-(f - mu)^2 / (2 sigma^2)) + b`, or the curve of the masks in place of the Gaussian.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Fit {
    /// Curve of the masks; `None` of a Gaussian.
    pub(crate) masks: Option<MaskCurve>,
    /// Amplitude, in the unit of the stack.
    pub(crate) amplitude: f64,
    /// Mask offset of the peak, m.
    pub(crate) centre: f64,
    /// Standard deviation, m of mask offset.
    pub(crate) width: f64,
    /// Background, in the unit of the stack.
    pub(crate) background: f64,
}

impl Fit {
    /// Value of the point of this index at its offset.
    fn at_point(&self, index: usize, offset: f64) -> f64 {
        self.at(offset + self.masks.as_ref().map_or(0.0, |masks| masks.to_slit(index)))
    }

    pub(crate) fn at(&self, offset: f64) -> f64 {
        let place = offset - self.centre;
        let relative = match &self.masks {
            Some(masks) => masks.relative(place, self.width),
            None => (-0.5 * (place / self.width).powi(2)).exp(),
        };
        self.amplitude * relative + self.background
    }
}

/// One of the curves of a pixel.
#[derive(Debug, Clone)]
pub(crate) struct CurvePlot {
    pub(crate) name: String,
    /// Intensity at every mask step.
    pub(crate) values: Vec<f64>,
    pub(crate) fit: Option<Fit>,
}

/// Room of the legend beside the curves.
const LEGEND: f64 = 250.0;

/// Draws curves over mask offsets (m); `label` names them, `note` is below the title, `notes` are lines
/// beside them.
pub(crate) fn draw(
    [title, note, label]: [&str; 3],
    offsets: &[f64],
    curves: &[CurvePlot],
    notes: &[String],
) -> Drawing {
    let fitted = curves.iter().any(|curve| curve.fit.is_some());
    let top = if note.is_empty() { 48.0 } else { 62.0 };
    let area = Area::new(LEFT + 14.0, top, 560.0, 330.0);
    let below = Area::new(area.left, area.bottom() + 16.0, area.width, 84.0);
    let bottom = if fitted { below.bottom() } else { area.bottom() };
    let mut drawing = Drawing::new(area.right() + LEGEND, bottom + BELOW + 8.0);
    drawing.text([area.left, 28.0], title, 17.0, INK, Anchor::Start);
    let note = cut(note, area.width + LEGEND - 10.0, SMALL);
    drawing.text([area.left, 47.0], note, SMALL, GREY, Anchor::Start);

    let micro: Vec<f64> = offsets.iter().map(|offset| 1e6 * offset).collect();
    let x = match roomy(micro.iter().copied()) {
        // One step, or several at one offset.
        [low, high] if high - low < 1e-3 => [low - 1.0, high + 1.0],
        range => range,
    };
    let fine: Vec<f64> = (0..=300).map(|i| x[0] + (x[1] - x[0]) * f64::from(i) / 300.0).collect();
    let values = curves.iter().flat_map(|curve| curve.values.iter().copied());
    let of_fits = curves.iter().filter_map(|curve| curve.fit.as_ref()).flat_map(|fit| {
        let offsets = fine.iter().map(|offset| 1e-6 * offset).collect::<Vec<_>>();
        offsets.into_iter().map(move |offset| fit.at(offset))
    });
    let [low, high] = roomy(values.chain(of_fits));
    let axes = Axes { area, x, y: [low.min(0.0), high], ..Axes::default() };
    axes.grid(&mut drawing);
    for (curve, colour) in curves.iter().zip(SET) {
        let dots = || micro.iter().zip(&curve.values).map(|(x, y)| [*x, *y]);
        if let Some(fit) = &curve.fit {
            let line = fine.iter().map(|x| [*x, fit.at(1e-6 * x)]);
            axes.curve(&mut drawing, line, Paint::line(colour, 1.8));
            let peak = 1e6 * fit.centre;
            let down = [[peak, axes.y[0]], [peak, fit.at(fit.centre)]];
            axes.curve(&mut drawing, down.into_iter(), Paint::dashed(colour, 1.0, 4.0));
        } else {
            axes.curve(&mut drawing, dots(), Paint::line(colour, 1.0));
        }
        axes.dots(&mut drawing, dots(), dot(colour));
    }
    axes.frame(&mut drawing, if fitted { "" } else { "mask offset [µm]" }, label);
    if fitted {
        residuals(&mut drawing, below, x, &micro, offsets, curves);
    }
    legend(&mut drawing, [area.right() + 18.0, area.top + 12.0], curves, notes);
    drawing
}

fn dot(colour: Rgb) -> Paint {
    Paint { fill: Some((colour, 1.0)), stroke: Some(([255; 3], 0.8)), dash: None }
}

fn residuals(
    drawing: &mut Drawing,
    area: Area,
    x: [f64; 2],
    micro: &[f64],
    offsets: &[f64],
    curves: &[CurvePlot],
) {
    let left = |curve: &CurvePlot| -> Vec<f64> {
        let Some(fit) = &curve.fit else { return Vec::new() };
        let points = curve.values.iter().zip(offsets).enumerate();
        points.map(|(index, (value, offset))| value - fit.at_point(index, *offset)).collect()
    };
    let all: Vec<Vec<f64>> = curves.iter().map(left).collect();
    let [low, high] = roomy(all.iter().flatten().copied());
    let most = low.abs().max(high.abs());
    let axes = Axes { area, x, y: [-most, most], ..Axes::default() };
    axes.grid(drawing);
    let zero = [[x[0], 0.0], [x[1], 0.0]];
    axes.curve(drawing, zero.into_iter(), Paint::line(GREY, 0.8));
    for (values, colour) in all.iter().zip(SET) {
        let points = || micro.iter().zip(values).map(|(x, y)| [*x, *y]);
        axes.curve(drawing, points(), Paint::line(colour, 0.8));
        axes.dots(drawing, points(), dot(colour));
    }
    axes.frame(drawing, "mask offset [µm]", "data − fit");
}

fn legend(drawing: &mut Drawing, [left, mut y]: [f64; 2], curves: &[CurvePlot], notes: &[String]) {
    for (curve, colour) in curves.iter().zip(SET) {
        drawing.disc([left + 7.0, y - 4.5], 4.0, dot(colour));
        drawing.text([left + 19.0, y], curve.name.clone(), 13.0, INK, Anchor::Start);
        y += 20.0;
        let Some(fit) = &curve.fit else { continue };
        for (name, value) in [
            ("A", super::text::short(fit.amplitude)),
            ("µ", format!("{} µm", super::text::short(1e6 * fit.centre))),
            ("σ", format!("{} µm", super::text::short(1e6 * fit.width))),
            ("b", super::text::short(fit.background)),
        ] {
            drawing.text([left + 19.0, y], format!("{name} = {value}"), SMALL, GREY, Anchor::Start);
            y += 16.0;
        }
        y += 8.0;
    }
    y += 6.0;
    // From where the legend begins to the edge of the paper.
    let width = LEGEND - 18.0 - 8.0;
    for line in notes.iter().flat_map(|note| wrapped(note, width, SMALL)) {
        drawing.text([left, y], line, SMALL, INK, Anchor::Start);
        y += 17.0;
    }
}
