//! An image in colours on axes in mm, with its bar; and sinograms.

use super::axes::{Axes, BELOW, LEFT};
use super::colour::{SMALL, Scale};
use super::drawing::{Anchor, Area, Drawing, GREY, INK};
use super::quantity::Quantity;
use beamlet::scene::Scene;
use ndarray::ArrayView2;

/// Longest side of an image on paper.
const SIDE: f64 = 560.0;
/// Shortest side: images of a few rows are stretched to it.
const LEAST: f64 = 90.0;
const ABOVE: f64 = 62.0;
/// Room of the bar with its words.
const BAR: f64 = 122.0;

/// What stands at an image.
#[derive(Debug, Clone)]
pub(crate) struct Words {
    pub(crate) title: String,
    pub(crate) note: String,
}

/// Draws `[row][column]` values in the unit of `quantity`, row 0 on top.
pub(crate) fn draw(
    scene: &Scene,
    values: ArrayView2<'_, f64>,
    quantity: &Quantity,
    scale: &Scale,
    words: &Words,
) -> Drawing {
    let (x, z) = (mm(scene, 0), mm(scene, 1));
    let labels = ["x on the detector [mm]", "z [mm]"];
    on_axes(values, quantity, scale, words, ([x, z], Vec::new()), labels, true)
}

/// Draws `[row][beamlet]` values: beamlets by their number from 0, rows by their z.
pub(crate) fn of_beamlets(
    scene: &Scene,
    values: ArrayView2<'_, f64>,
    quantity: &Quantity,
    scale: &Scale,
    words: &Words,
) -> Drawing {
    let ranges = [[-0.5, values.ncols() as f64 - 0.5], mm(scene, 1)];
    let labels = ["beamlet", "z [mm]"];
    on_axes(values, quantity, scale, words, (ranges, Vec::new()), labels, false)
}

/// Draws `[view][column]` values, view 0 on top, over angles in degrees; where these are not
/// evenly spaced every view is as high as any other, with its angle beside it.
pub(crate) fn sinogram(
    scene: &Scene,
    values: ArrayView2<'_, f64>,
    quantity: &Quantity,
    scale: &Scale,
    words: &Words,
) -> Drawing {
    let angles: Vec<f64> = scene.scan.angles.iter().map(|angle| angle.to_degrees()).collect();
    let shown = &angles[..values.nrows().min(angles.len())];
    let even = shown.windows(3).all(|w| ((w[2] - w[1]) - (w[1] - w[0])).abs() < 1e-6);
    let (y, marks) = match shown {
        [first, second, .., last] | [first, second @ last] if even && second > first => {
            let half = (second - first) / 2.0;
            ([last + half, first - half], Vec::new())
        }
        _ => {
            let mark = |(view, angle): (usize, &f64)| (view as f64, super::text::short(*angle));
            let marks = shown.iter().enumerate().map(mark).collect();
            ([values.nrows() as f64 - 0.5, -0.5], marks)
        }
    };
    let labels = ["x on the detector [mm]", "angle [°]"];
    on_axes(values, quantity, scale, words, ([mm(scene, 0), y], marks), labels, false)
}

/// Range of x (axis 0) or z (axis 1) on the detector, mm.
pub(crate) fn mm(scene: &Scene, axis: usize) -> [f64; 2] {
    let half = 1e3 * scene.detector.pitch[axis] * f64::from(scene.detector.pixels[axis]) / 2.0;
    [-half, half]
}

fn on_axes(
    values: ArrayView2<'_, f64>,
    quantity: &Quantity,
    scale: &Scale,
    words: &Words,
    ([x, y], marks): ([[f64; 2]; 2], Vec<(f64, String)>),
    labels: [&str; 2],
    equal: bool,
) -> Drawing {
    let ratio = if equal { ((y[1] - y[0]) / (x[1] - x[0])).abs() } else { 0.75 };
    let (width, height) = match ratio > 1.0 {
        true => ((SIDE / ratio).max(LEAST), SIDE),
        false => (SIDE, (SIDE * ratio).max(LEAST)),
    };
    let area = Area::new(LEFT + 10.0, ABOVE, width, height);
    let right = area.right() + 20.0 + 16.0 + BAR;
    let least = super::drawing::text_width(&words.note, SMALL) + area.left + 12.0;
    let mut drawing = Drawing::new(right.max(least), area.bottom() + BELOW + 6.0);
    let pixels = values.iter().map(|value| scale.colour(*value)).collect();
    drawing.pixels(area, values.ncols(), pixels);
    Axes { area, x, y, marks }.frame(&mut drawing, labels[0], labels[1]);
    drawing.text([area.left, 26.0], words.title.clone(), 17.0, INK, Anchor::Start);
    drawing.text([area.left, 46.0], words.note.clone(), SMALL, GREY, Anchor::Start);
    let bar = Area::new(area.right() + 20.0, area.top + 12.0, 16.0, area.height - 24.0);
    scale.bar(&mut drawing, bar, &quantity.words());
    drawing
}
