//! Values along a row, one panel above the other.

use super::axes::{Axes, BELOW, LEFT, roomy};
use super::colour::{SET, SMALL};
use super::drawing::{Anchor, Area, Drawing, INK, Paint, text_width};

/// A line of a panel.
#[derive(Debug, Clone)]
pub(crate) struct ProfileLine {
    /// In the legend; empty where the panel has one line.
    pub(crate) name: String,
    pub(crate) values: Vec<f64>,
    /// 1 sigma of the values, drawn as a band.
    pub(crate) sigma: Option<Vec<f64>>,
}

impl ProfileLine {
    /// Values and the edges of their band.
    fn reach(&self) -> Vec<f64> {
        let of = |sign: f64| {
            let sigma = self.sigma.iter().flatten();
            self.values.iter().zip(sigma).map(move |(value, sigma)| value + sign * sigma)
        };
        self.values.iter().copied().chain(of(1.0)).chain(of(-1.0)).collect()
    }
}

/// Lines over one axis of y.
#[derive(Debug, Clone)]
pub(crate) struct Panel {
    pub(crate) label: String,
    pub(crate) lines: Vec<ProfileLine>,
    /// Whether a line stands at zero.
    pub(crate) zero: bool,
}

const HEIGHT: f64 = 170.0;
const GAP: f64 = 16.0;

/// Draws panels over the same x.
pub(crate) fn draw(title: &str, x: &[f64], across: &str, panels: &[Panel]) -> Drawing {
    let count = panels.len() as f64;
    let mut drawing =
        Drawing::new(LEFT + 14.0 + 700.0 + 24.0, 46.0 + count * (HEIGHT + GAP) + BELOW - 6.0);
    drawing.text([LEFT + 14.0, 28.0], title, 17.0, INK, Anchor::Start);
    let range = x.first().zip(x.last()).map_or([0.0, 1.0], |(a, b)| match a < b {
        true => [*a, *b],
        false => [a - 0.5, a + 0.5],
    });
    let mut top = 46.0;
    for (index, panel) in panels.iter().enumerate() {
        let area = Area::new(LEFT + 14.0, top, 700.0, HEIGHT);
        let axes = Axes {
            area,
            x: range,
            y: roomy(panel.lines.iter().flat_map(ProfileLine::reach)),
            ..Axes::default()
        };
        axes.grid(&mut drawing);
        if panel.zero {
            let zero = [[range[0], 0.0], [range[1], 0.0]];
            axes.curve(&mut drawing, zero.into_iter(), Paint::line([90, 90, 96], 0.9));
        }
        for (line, colour) in panel.lines.iter().zip(SET) {
            if let Some(sigma) = &line.sigma {
                let edge = |sign: f64| {
                    let values = line.values.iter().zip(sigma).map(move |(v, s)| v + sign * s);
                    x.iter().zip(values).map(|(x, v)| axes.at([*x, v])).collect::<Vec<_>>()
                };
                let mut band = edge(1.0);
                band.extend(edge(-1.0).into_iter().rev());
                if band.iter().flatten().all(|value| value.is_finite()) {
                    drawing.clip(Some(area));
                    drawing.path(
                        band,
                        true,
                        Paint { fill: Some((colour, 0.22)), ..Paint::default() },
                    );
                    drawing.clip(None);
                }
            }
            let points = || x.iter().zip(&line.values).map(|(x, y)| [*x, *y]);
            axes.curve(&mut drawing, points(), Paint::line(colour, 1.6));
            // Few pixels show as what they are; one would not show at all.
            if x.len() <= 24 {
                axes.dots(&mut drawing, points(), Paint::fill(colour));
            }
        }
        let last = index + 1 == panels.len();
        axes.frame(&mut drawing, if last { across } else { "" }, &panel.label);
        legend(&mut drawing, area, panel);
        top += HEIGHT + GAP;
    }
    drawing
}

fn legend(drawing: &mut Drawing, area: Area, panel: &Panel) {
    let mut right = area.right() - 8.0;
    for (line, colour) in panel.lines.iter().zip(SET).rev() {
        if line.name.is_empty() {
            continue;
        }
        let y = area.top - 6.0;
        drawing.text([right, y], line.name.clone(), SMALL, INK, Anchor::End);
        let left = right - text_width(&line.name, SMALL) - 6.0;
        drawing.line([left - 20.0, y - 4.0], [left, y - 4.0], Paint::line(colour, 2.0));
        right = left - 34.0;
    }
}
