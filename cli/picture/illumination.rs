//! The illumination curve of a set-up over a period, and the offsets of its scan.

use super::axes::{Axes, BELOW, LEFT};
use super::colour::{SET, SMALL};
use super::drawing::{Anchor, Area, Drawing, GREY, INK, Paint};
use super::text::{length, short};
use beamlet::check::IlluminationCurve;

/// Draws light over the mask offset, with σ, the middle between least and greatest light, and the
/// uncertainties to expect.
pub(crate) fn draw(title: &str, curve: &IlluminationCurve) -> Drawing {
    let area = Area::new(LEFT + 14.0, 88.0, 700.0, 330.0);
    let mut drawing = Drawing::new(area.right() + 24.0, area.bottom() + BELOW + 8.0);
    drawing.text([area.left, 28.0], title, 17.0, INK, Anchor::Start);
    for (note, y) in notes(curve).iter().zip([49.0, 66.0]) {
        drawing.text([area.left, y], note, SMALL, GREY, Anchor::Start);
    }
    let [low, high] = curve
        .light
        .iter()
        .fold([f64::INFINITY, 0.0_f64], |[low, high], light| [low.min(*light), high.max(*light)]);
    let scan: Vec<[f64; 2]> = curve.scan.iter().map(|[at, light]| [at * 1e6, *light]).collect();
    let farthest = scan.iter().fold(0.5e6 * curve.period, |most, [at, _]| most.max(at.abs()));
    let axes = Axes { area, x: [-farthest, farthest], y: [0.0, 1.08 * high], ..Axes::default() };
    axes.grid(&mut drawing);
    let points = || curve.offsets.iter().zip(&curve.light).map(|(at, light)| [at * 1e6, *light]);
    axes.curve(&mut drawing, points(), Paint::line(SET[0], 1.8));
    for sign in [-1.0, 1.0] {
        let sigma = [0.0, axes.y[1]].map(|y| [sign * curve.sigma * 1e6, y]);
        axes.curve(&mut drawing, sigma.into_iter(), Paint::dashed(GREY, 1.0, 4.0));
    }
    let middle = f64::midpoint(low, high);
    let width = [-0.5e6, 0.5e6].map(|side| [side * curve.fwhm, middle]);
    axes.curve(&mut drawing, width.into_iter(), Paint::line(GREY, 1.2));
    axes.dots(&mut drawing, scan.into_iter(), Paint::fill(SET[1]));
    axes.frame(&mut drawing, "mask offset [µm]", "light without sample, open beam = 1");
    drawing
}

fn notes(curve: &IlluminationCurve) -> [String; 2] {
    let [low, high] = curve.reach();
    let set_up = format!(
        "visibility {} %; σ {} (dashed), FWHM {}; offsets of the scan (dots) {low:.2} to {high:.2} σ",
        short(curve.visibility * 100.0),
        length(curve.sigma),
        length(curve.fwhm)
    );
    let expected = curve.expected.map_or_else(
        || "no expected uncertainties: detector.photons or detector.exposure is not set".to_owned(),
        |it| {
            format!(
                "1σ of a pixel without sample: transmission {:.1e}, refraction {:.1e} µrad, dark field \
                 {:.1e} µrad²",
                it.transmission,
                it.refraction * 1e6,
                it.dark_field * 1e12
            )
        },
    );
    [set_up, expected].map(|text| text.replace('-', "−"))
}
