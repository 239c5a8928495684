//! The set-up to scale, seen from above: beam to the right, x downwards.

use super::axes::{Axes, BELOW, LEFT};
use super::colour::{Rgb, SMALL};
use super::drawing::{Anchor, Area, Drawing, GREY, INK, Paint, text_width};
use super::palette::{self, colour_of_object, pale};
use super::section::{Loop, outlines, section, thinned};
use super::text::{cut, distance, joined, length};
use beamlet::Result;
use beamlet::cli_support::{FrontView, Placed, numbers, require_memory};
use beamlet::geometry::Sample;
use beamlet::scene::{MaskBody, MaskSpec, Scene};
use glam::DVec3;

const WIDTH: f64 = 1180.0;
const BEAM: Rgb = [250, 205, 70];
const BARS: Rgb = [70, 70, 82];
/// Light of apertures seen from the source.
const LIGHT: Rgb = [253, 240, 200];
/// Strips of a round aperture.
const STRIPS: u32 = 48;
/// Narrowest apertures that a drawing shows on either side of the axis.
const MOST_SEEN: f64 = 40.0;
const DETECTOR: Rgb = [40, 110, 150];

/// Bytes for each triangle that is drawn, of meshes and of instances that the section cuts: its corners for the outline,
/// and its two corners of the section.
const OF_TRIANGLE: u64 = 320;

/// Draws the set-up at angle 0.
///
/// Fails where there is not the memory for it.
pub(crate) fn draw(scene: &Scene, sample: &Sample) -> Result<Drawing> {
    let is_cut = |placed: &Placed| {
        let [low, high] = sample.extent_of_placed(placed, DVec3::Z);
        low <= 0.0 && high >= 0.0
    };
    let triangles = sample.triangles_as_meshes_of(is_cut);
    require_memory(OF_TRIANGLE.saturating_mul(triangles), "the drawing of the set-up")?;
    let above = FromAbove {
        outlines: outlines(sample),
        loops: section(&sample.as_meshes_of(is_cut)),
        sample,
    };
    let mut drawing = Drawing::new(WIDTH, 944.0);
    let heading = joined(&["Set-up from above".into(), scene.title.clone().unwrap_or_default()]);
    let heading = cut(&heading, WIDTH - LEFT - 20.0, 19.0);
    drawing.text([LEFT, 28.0], heading, 19.0, INK, Anchor::Start);
    drawing.text([LEFT, 48.0], caption(scene), SMALL, GREY, Anchor::Start);
    overview(&mut drawing, scene, &above);
    true_scale(&mut drawing, scene);
    insets(&mut drawing, scene, &above);
    Ok(drawing)
}

/// The sample seen from above, m.
struct FromAbove<'s> {
    sample: &'s Sample,
    /// Outline of each object.
    outlines: Vec<Vec<[f64; 2]>>,
    /// Lines of the section at z = 0.
    loops: Vec<Loop>,
}

impl FromAbove<'_> {
    /// The largest of some number of the points of the outlines.
    fn reach(&self, of: impl Fn(&[f64; 2]) -> f64) -> f64 {
        self.outlines.iter().flatten().map(of).fold(0.0, f64::max)
    }
}

fn caption(scene: &Scene) -> String {
    let [columns, rows] = scene.detector.pixels;
    let [x, z] = scene.detector.pitch.map(length);
    let [across, up] = scene.source.spot.fwhm();
    let spot = match scene.source.spot.parts().len() {
        1 if across == 0.0 && up == 0.0 => "a point".to_owned(),
        1 => format!("{} × {} (FWHM)", length(across), length(up)),
        n => format!(
            "of {n} Gaussians, {} × {} (FWHM from the variance)",
            length(across),
            length(up)
        ),
    };
    let views = match scene.scan.views() {
        1 => "1 view".to_owned(),
        count => format!("{count} views (angle 0 is drawn)"),
    };
    let magnification = match scene.sample_mask {
        Some(_) => format!(" · mask magnification {:.4}", scene.magnification()),
        None => String::new(),
    };
    let steps = match scene.mask_steps() {
        1 => "1 mask step".to_owned(),
        count => format!("{count} mask steps"),
    };
    format!(
        "focal spot {spot} · detector {columns} × {rows} pixels of {x} × {z}{magnification} · \
         {views} · {steps}"
    )
}

/// Half the width that the drawing has to show, m.
fn half_width(scene: &Scene) -> f64 {
    scene.detector.pitch[0] * f64::from(scene.detector.pixels[0]) / 2.0
}

/// y of the world, m, of a distance from the source.
fn beyond(scene: &Scene, distance: f64) -> f64 {
    distance - scene.source.distance
}

/// Everything between source and detector; x is stretched.
fn overview(drawing: &mut Drawing, scene: &Scene, above: &FromAbove<'_>) {
    let area = Area::new(LEFT + 12.0, 86.0, WIDTH - LEFT - 42.0, 268.0);
    let reach = above.reach(|[x, _]| x.abs()).max(half_width(scene)) * 1.18;
    let total = scene.detector.distance;
    // x grows downwards, as it does seen from above with the beam to the right.
    let axes = Axes {
        area,
        x: [-0.04 * total, 1.035 * total],
        y: [1e3 * reach, -1e3 * reach],
        ..Axes::default()
    };
    let half = 1e3 * half_width(scene);
    let fan = vec![axes.at([0.0, 0.0]), axes.at([total, -half]), axes.at([total, half])];
    drawing.path(fan, true, Paint { fill: Some((BEAM, 0.22)), ..Paint::line(BEAM, 1.0) });
    let axis = Paint::dashed(GREY, 0.8, 5.0);
    drawing.line(axes.at([0.0, 0.0]), axes.at([total, 0.0]), axis);
    let shifted = |[x, y]: [f64; 2]| axes.at([y + scene.source.distance, 1e3 * x]);
    sample_from_above(drawing, scene, above, &shifted);
    let masks = [(&scene.sample_mask, "sample mask"), (&scene.detector_mask, "detector mask")];
    for (mask, name) in masks {
        let Some(mask) = mask else { continue };
        mask_line(drawing, &axes, mask, reach);
        let at = axes.at([mask.distance, -1e3 * reach]);
        let anchor = if mask.distance > 0.8 * total { Anchor::End } else { Anchor::Middle };
        drawing.text([at[0], at[1] - 6.0], name, 13.0, INK, anchor);
    }
    let [left, top] = axes.at([total, -half]);
    let [_, bottom] = axes.at([total, half]);
    drawing.area(Area::new(left, top, 7.0, bottom - top), Paint::fill(DETECTOR));
    let below = f64::midpoint(bottom, axes.down(1e3 * reach)) + 4.0;
    drawing.text([left - 8.0, below], "detector", 13.0, INK, Anchor::End);
    let source = axes.at([0.0, 0.0]);
    drawing.disc(source, 5.0, Paint { fill: Some((BEAM, 1.0)), ..Paint::line(INK, 1.0) });
    drawing.text([source[0], source[1] - 12.0], "source", 13.0, INK, Anchor::Middle);
    if !above.sample.objects.is_empty() {
        let at = axes.at([scene.source.distance, 0.0]);
        drawing.text([at[0] + 8.0, at[1] - 6.0], "sample", 13.0, INK, Anchor::Start);
    }
    direction_of_stepping(drawing, scene, &axes, reach);
    axes.frame(drawing, "distance from the source [m]", "x [mm], stretched");
    dimensions(drawing, scene, &axes);
}

/// A mask as its bars, where they are wide enough to be seen, or as a strip.
fn mask_line(drawing: &mut Drawing, axes: &Axes, mask: &MaskSpec, reach: f64) {
    let x = axes.across(mask.distance);
    let (top, bottom) = (axes.down(-1e3 * reach), axes.down(1e3 * reach));
    let period = (axes.down(1e3 * mask.period) - axes.down(0.0)).abs();
    drawing.clip(Some(Area::new(x - 3.0, top, 6.0, bottom - top)));
    if period < 5.0 || mask.list_key().is_some() {
        drawing.line([x, top], [x, bottom], Paint::line(BARS, 4.0));
    } else {
        // Bars lie between apertures; the inset shows which of them is in the middle.
        let pattern = mask.pattern();
        let count = (reach / pattern).ceil();
        let mut k = -count - 1.0;
        while k <= count {
            let centre = (k + 0.5) * pattern + mask.offset;
            for [low, high] in mask.bars() {
                let ends = [low, high].map(|end| axes.down(1e3 * (centre + end)));
                drawing.line([x, ends[0]], [x, ends[1]], Paint::line(BARS, 4.0));
            }
            k += 1.0;
        }
    }
    drawing.clip(None);
}

fn direction_of_stepping(drawing: &mut Drawing, scene: &Scene, axes: &Axes, reach: f64) {
    let Some(mask) = scene.sample_mask.as_ref().filter(|_| scene.mask_steps() > 1) else { return };
    let x = axes.across(mask.distance) - 14.0;
    let middle = axes.down(-0.62e3 * reach);
    drawing.arrow([x, middle - 22.0], [x, middle + 22.0], INK, 1.2);
    drawing.text([x - 6.0, middle + 5.0], "mask offset f", SMALL, INK, Anchor::End);
}

/// Outline and section of the sample through a map from metres to paper.
fn sample_from_above(
    drawing: &mut Drawing,
    scene: &Scene,
    above: &FromAbove<'_>,
    map: &dyn Fn([f64; 2]) -> [f64; 2],
) {
    for one in &above.loops {
        let colour = match one.hole {
            false => colour_of_object(scene, Some(one.object)),
            true => colour_of_object(scene, one.outside),
        };
        let fill = if colour == palette::EMPTY { colour } else { pale(colour, 0.55) };
        let points: Vec<[f64; 2]> = one.points.iter().map(|point| map(*point)).collect();
        let edge = colour_of_object(scene, Some(one.object));
        let paint = Paint { fill: Some((fill, 1.0)), ..Paint::line(edge, 1.0) };
        drawing.path(thinned(&points, 0.12), true, paint);
    }
    for (object, outline) in (0..).zip(&above.outlines).filter(|(_, it)| !it.is_empty()) {
        let points: Vec<[f64; 2]> = outline.iter().map(|point| map(*point)).collect();
        let colour = pale(colour_of_object(scene, Some(object)), 0.75);
        drawing.path(thinned(&points, 0.12), true, Paint::dashed(colour, 0.9, 3.0));
    }
}

/// Distances below the overview, one above the other.
fn dimensions(drawing: &mut Drawing, scene: &Scene, axes: &Axes) {
    let mut all = Vec::new();
    if let Some(mask) = &scene.sample_mask {
        all.push((0.0, mask.distance, "source to sample mask"));
    }
    all.push((0.0, scene.source.distance, "source to rotation centre"));
    if let Some(mask) = &scene.detector_mask {
        all.push((0.0, mask.distance, "source to detector mask"));
    }
    all.push((0.0, scene.detector.distance, "source to detector"));
    let top = axes.area.bottom() + 60.0;
    for (row, (from, to, what)) in (0_u32..).zip(all) {
        let y = top + 19.0 * f64::from(row);
        let (left, right) = (axes.across(from), axes.across(to));
        let text = format!("{what} {}", distance(to - from));
        let middle = f64::midpoint(left, right);
        let half = text_width(&text, SMALL) / 2.0 + 8.0;
        drawing.text([middle, y + 4.2], text, SMALL, INK, Anchor::Middle);
        drawing.arrow([middle - half, y], [left, y], GREY, 0.8);
        drawing.arrow([middle + half, y], [right, y], GREY, 0.8);
        let thin = Paint::line(GREY, 0.6);
        for x in [left, right] {
            drawing.line([x, y - 5.0], [x, y + 5.0], thin);
        }
    }
}

/// The whole set-up with equal scales of x and y.
fn true_scale(drawing: &mut Drawing, scene: &Scene) {
    let total = scene.detector.distance;
    let (left, width) = (LEFT + 12.0, WIDTH - LEFT - 42.0);
    let across = |y: f64| left + (y + 0.04 * total) / (1.075 * total) * width;
    let scale = width / (1.075 * total);
    let half = half_width(scene) * scale;
    let middle = 512.0;
    let fan =
        vec![[across(0.0), middle], [across(total), middle - half], [across(total), middle + half]];
    drawing.path(fan, true, Paint { fill: Some((BEAM, 0.5)), ..Paint::line(BEAM, 0.5) });
    let masks = [&scene.sample_mask, &scene.detector_mask];
    for mask in masks.into_iter().flatten() {
        let x = across(mask.distance);
        let half = (half * mask.distance / total).max(2.0);
        let width = (mask.body.thickness() * scale).max(0.7);
        drawing.line([x, middle - half], [x, middle + half], Paint::line(BARS, width));
    }
    let x = across(total);
    let half = half.max(2.0);
    drawing.line([x, middle - half], [x, middle + half], Paint::line(DETECTOR, 2.0));
    drawing.text(
        [left + width, middle - half - 5.0],
        "the same drawing with equal scales of x and y",
        SMALL,
        GREY,
        Anchor::End,
    );
}

/// Sample and bars of the masks, magnified, each with x and y at one scale.
fn insets(drawing: &mut Drawing, scene: &Scene, above: &FromAbove<'_>) {
    let mut left = LEFT + 12.0;
    let top = 576.0;
    if !above.sample.objects.is_empty() {
        sample_inset(drawing, scene, above, Area::new(left, top, 268.0, 268.0));
        left += 268.0 + LEFT + 40.0;
    }
    let masks = [(&scene.sample_mask, "sample mask"), (&scene.detector_mask, "detector mask")];
    for (mask, name) in masks {
        if let Some(mask) = mask {
            let area = Area::new(left, top, 268.0, 268.0);
            match FrontView::of(mask, scene.detector.pixels, STRIPS) {
                Some(view) => mask_from_source(drawing, mask, &view, name, area),
                None => mask_inset(drawing, scene, mask, name, area),
            }
            mask_text(drawing, mask, area);
            left += 268.0 + LEFT + 40.0;
        }
    }
}

fn sample_inset(drawing: &mut Drawing, scene: &Scene, above: &FromAbove<'_>, area: Area) {
    let reach = above.reach(|[x, y]| x.hypot(*y));
    let half = 1e3 * reach.max(1e-6) * 1.3;
    let axes = Axes { area, x: [-half, half], y: [half, -half], ..Axes::default() };
    drawing.clip(Some(area));
    for mask in [&scene.sample_mask, &scene.detector_mask].into_iter().flatten() {
        let y = 1e3 * beyond(scene, mask.distance);
        let width = (mask.body.thickness() * 1e3 / (2.0 * half) * area.width).max(1.0);
        drawing.line(axes.at([y, -half]), axes.at([y, half]), Paint::line(BARS, width));
    }
    drawing.clip(None);
    sample_from_above(drawing, scene, above, &|[x, y]| axes.at([1e3 * y, 1e3 * x]));
    let centre = axes.at([0.0, 0.0]);
    let cross = Paint::line(INK, 1.0);
    drawing.line([centre[0] - 5.0, centre[1]], [centre[0] + 5.0, centre[1]], cross);
    drawing.line([centre[0], centre[1] - 5.0], [centre[0], centre[1] + 5.0], cross);
    axes.frame(drawing, "y from the rotation centre [mm]", "x [mm]");
    let title = "sample: section at z = 0, outline dashed";
    drawing.text([area.left, area.top - 10.0], title, 13.0, INK, Anchor::Start);
    let (mut x, mut y) = (area.left, area.bottom() + BELOW + 16.0);
    for material in palette::materials(scene).into_iter().take(6) {
        let wide = 17.0 + text_width(material, SMALL) + 16.0;
        if x > area.left && x + wide > area.right() + 40.0 {
            (x, y) = (area.left, y + 17.0);
        }
        let colour = palette::colour_of(scene, material);
        let paint = Paint { fill: Some((pale(colour, 0.55), 1.0)), ..Paint::line(colour, 1.0) };
        drawing.area(Area::new(x, y - 10.0, 12.0, 12.0), paint);
        drawing.text([x + 17.0, y], material, SMALL, INK, Anchor::Start);
        x += wide;
    }
}

/// A few bars about the axis, with period, aperture and thickness.
fn mask_inset(drawing: &mut Drawing, scene: &Scene, mask: &MaskSpec, name: &str, area: Area) {
    let thickness = mask.body.thickness();
    let half = 1e6 * (1.6 * mask.period).max(0.62 * thickness);
    let axes = Axes { area, x: [-half, half], y: [half, -half], ..Axes::default() };
    let columns = f64::from(scene.detector.pixels[0]);
    drawing.clip(Some(area));
    let periods = half * 1e-6 / mask.period;
    let mut index = -periods.floor() - 2.0;
    if 2.0 * periods > area.height {
        // Masks far thicker than their period, whose bars are finer than pixels: their mean.
        let opacity = 1.0 - mask.open_share();
        let (left, right) = (axes.across(-5e5 * thickness), axes.across(5e5 * thickness));
        let bars = Area::new(left, area.top, (right - left).max(2.5), area.height);
        drawing.area(bars, Paint { fill: Some((BARS, opacity)), ..Paint::default() });
        index = f64::INFINITY;
    }
    // The light of the apertures, and the rows of pixels behind.
    while index < periods + 1.0 {
        // Period k is centred at (k + 1/2 - C/2) periods.
        let phase = 0.5 - (columns / 2.0).fract();
        let number = index + phase - 0.5 + columns / 2.0;
        let shift = |number: f64| match mask.shifts.len() {
            0 => 0.0,
            count => mask.shifts[numbers::whole::<usize>(number.rem_euclid(count as f64).floor())],
        };
        let centre = (index + phase) * mask.period + mask.offset + shift(number);
        let slits = mask.slits_of_period();
        let next = slits[0][0] + mask.period + shift(number + 1.0) - shift(number);
        let ends = slits.iter().skip(1).map(|[low, _]| *low).chain([next]);
        for ([low, high], end) in slits.iter().zip(ends) {
            let light = axes.at([-half, 1e6 * (centre + low)]);
            let last = axes.at([half, 1e6 * (centre + high)]);
            let beam = Area::new(light[0], light[1], last[0] - light[0], last[1] - light[1]);
            drawing.area(beam, Paint { fill: Some((BEAM, 0.35)), ..Paint::default() });
            let from = axes.at([-5e5 * thickness, 1e6 * (centre + high)]);
            let to = axes.at([5e5 * thickness, 1e6 * (centre + end)]);
            let width = (to[0] - from[0]).max(2.5);
            let slant = 0.5 * thickness * mask.wall_slope();
            if slant != 0.0 {
                let face = |way: f64| {
                    let ends = [centre + high + way * slant, centre + end - way * slant];
                    ends.map(|x| axes.at([way * 5e5 * thickness, 1e6 * x]))
                };
                let ([a, b], [d, c]) = (face(-1.0), face(1.0));
                drawing.path(vec![a, b, c, d], true, Paint::fill(BARS));
                continue;
            }
            drawing.area(Area::new(from[0], from[1], width, to[1] - from[1]), Paint::fill(BARS));
        }
        index += 1.0;
    }
    drawing.clip(None);
    axes.frame(drawing, &format!("y from the centre of the {name} [µm]"), "x [µm]");
    drawing.text([area.left, area.top - 10.0], name, 13.0, INK, Anchor::Start);
}

/// Apertures about the axis as the source sees them, z upwards.
fn mask_from_source(
    drawing: &mut Drawing,
    mask: &MaskSpec,
    view: &FrontView,
    name: &str,
    area: Area,
) {
    let whole = view.period.max(view.strips.period);
    let narrowest = mask.aperture.min(mask.aperture_z.unwrap_or(mask.aperture));
    let half = if mask.list_key().is_some() { 0.55 * whole } else { 1.6 * whole };
    let half = half.min(MOST_SEEN * narrowest);
    let axes = Axes {
        area,
        x: [-1e6 * half, 1e6 * half],
        y: [-1e6 * half, 1e6 * half],
        ..Axes::default()
    };
    drawing.clip(Some(area));
    drawing.area(area, Paint::fill(BARS));
    let (across, up) = ([view.centre, view.period], [view.strips.centre, view.strips.period]);
    for z in centres(up, half + 0.5 * up[1]) {
        let seen =
            |ends: &[f64; 2], centre: f64| centre + ends[1] > -half && centre + ends[0] < half;
        for strip in view.strips.strips.iter().filter(|strip| seen(&strip.z, z)) {
            for x in centres(across, half + across[1]) {
                for ends in strip.x.iter().filter(|ends| seen(ends, x)) {
                    let [left, bottom] = axes.at([1e6 * (x + ends[0]), 1e6 * (z + strip.z[0])]);
                    let [right, top] = axes.at([1e6 * (x + ends[1]), 1e6 * (z + strip.z[1])]);
                    drawing
                        .area(Area::new(left, top, right - left, bottom - top), Paint::fill(LIGHT));
                }
            }
        }
    }
    drawing.clip(None);
    axes.frame(drawing, "x [µm]", "z [µm]");
    let title = format!("{name}, from the source");
    drawing.text([area.left, area.top - 10.0], title, 13.0, INK, Anchor::Start);
}

/// Centres of periods within reach of the axis.
fn centres([centre, period]: [f64; 2], reach: f64) -> impl Iterator<Item = f64> {
    let first = ((-reach - centre) / period).ceil();
    let count = ((reach - centre) / period).floor() - first + 1.0;
    (0..numbers::whole::<u32>(count.max(0.0)))
        .map(move |k| centre + (first + f64::from(k)) * period)
}

/// Period, apertures and body of a mask, below its drawing.
fn mask_text(drawing: &mut Drawing, mask: &MaskSpec, area: Area) {
    let body = match &mask.body {
        MaskBody::Sheet { transmission } => format!("sheet, transmission {transmission}"),
        body => {
            let layer = |(material, thickness): &(&str, f64)| {
                format!("{material}, {} thick", length(*thickness))
            };
            body.layers().iter().map(layer).collect::<Vec<_>>().join("; ")
        }
    };
    let both = |[x, z]: [Option<f64>; 2]| {
        [x, z].into_iter().flatten().map(length).collect::<Vec<_>>().join(" × ")
    };
    let period = both([Some(mask.period), mask.period_z]);
    let aperture = both([Some(mask.aperture), mask.aperture_z]);
    let narrowest = if mask.list_key().is_some() { "narrowest " } else { "" };
    let mut lines = vec![format!("{narrowest}aperture {aperture}"), body];
    let mut lattice = format!("period {period}");
    if mask.period_z.is_none() {
        lattice += &format!(", {}", lines.remove(0));
    }
    if mask.apertures.len() > 1 {
        lattice += &format!(", {} to a period", mask.apertures.len());
    }
    if !mask.shifts.is_empty() {
        lattice += &format!(", {} shifts", mask.shifts.len());
    }
    lines.insert(0, lattice);
    for (row, text) in (0_u32..).zip(lines) {
        let y = area.bottom() + BELOW + 16.0 + 15.0 * f64::from(row);
        drawing.text([area.left, y], text, SMALL, INK, Anchor::Start);
    }
}
