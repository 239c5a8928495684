//! A drawing as PNG.

use super::colour::Rgb;
use super::drawing::{Anchor, Area, Drawing, Item, Paint};
use super::font;
use crate::numbers::{self, single};
use tiny_skia::{
    Color, FillRule, LineCap, LineJoin, Mask, PathBuilder, Pixmap, PremultipliedColorU8, Rect,
    Stroke, StrokeDash, Transform,
};

impl Drawing {
    /// Width and height of the PNG file, pixels.
    pub(crate) fn pixels_at(&self, scale: f64) -> [u32; 2] {
        [self.width, self.height].map(|side| numbers::whole::<u32>((side * scale).round()))
    }

    /// The drawing as a PNG file on white, `scale` pixels to a unit.
    ///
    /// Fails where the picture is too large to be drawn.
    pub(crate) fn to_png(&self, scale: f64) -> Result<Vec<u8>, String> {
        let [width, height] = self.pixels_at(scale);
        let too_large = || format!("a picture of {width} x {height} pixels cannot be drawn");
        let mut pixmap = Pixmap::new(width, height).ok_or_else(too_large)?;
        pixmap.fill(Color::WHITE);
        for item in &self.items {
            draw(&mut pixmap, item, scale);
        }
        pixmap.encode_png().map_err(|error| error.to_string())
    }
}

/// A block of pixels as a PNG file of its own, a pixel each; `None` where it is empty.
pub(super) fn block_as_png(columns: usize, pixels: &[Rgb]) -> Option<Vec<u8>> {
    let rows = pixels.len() / columns.max(1);
    let [width, height] = [columns, rows].map(|side| u32::try_from(side).ok());
    let mut pixmap = Pixmap::new(width?, height?)?;
    for (to, [r, g, b]) in pixmap.pixels_mut().iter_mut().zip(pixels) {
        *to = PremultipliedColorU8::from_rgba(*r, *g, *b, 255)?;
    }
    pixmap.encode_png().ok()
}

fn draw(pixmap: &mut Pixmap, item: &Item, scale: f64) {
    let transform = Transform::from_scale(single(scale), single(scale));
    match item {
        Item::Path { points, closed, paint, clip } => {
            let mut builder = PathBuilder::new();
            for (index, [x, y]) in points.iter().enumerate() {
                match index {
                    0 => builder.move_to(single(*x), single(*y)),
                    _ => builder.line_to(single(*x), single(*y)),
                }
            }
            if *closed {
                builder.close();
            }
            let mask = clip.and_then(|area| clip_mask(pixmap, area, transform));
            if let Some(path) = builder.finish() {
                paint_path(pixmap, &path, paint, transform, mask.as_ref());
            }
        }
        Item::Disc { at, radius, paint } => {
            let circle = PathBuilder::from_circle(single(at[0]), single(at[1]), single(*radius));
            if let Some(path) = circle {
                paint_path(pixmap, &path, paint, transform, None);
            }
        }
        Item::Text { at, text, size, colour, anchor, upwards } => {
            let Some(path) = font::outline(text, *size) else { return };
            let width = font::width(text, *size);
            let shift = match anchor {
                Anchor::Start => 0.0,
                Anchor::Middle => -width / 2.0,
                Anchor::End => -width,
            };
            let placed = transform.pre_translate(single(at[0]), single(at[1]));
            let turned = if *upwards { placed.pre_rotate(-90.0) } else { placed };
            let moved = turned.pre_translate(single(shift), 0.0);
            paint_path(pixmap, &path, &Paint::fill(*colour), moved, None);
        }
        Item::Pixels { area, columns, pixels } => blocks(pixmap, *area, *columns, pixels, scale),
    }
}

fn clip_mask(pixmap: &Pixmap, area: Area, transform: Transform) -> Option<Mask> {
    let mut mask = Mask::new(pixmap.width(), pixmap.height())?;
    let path = PathBuilder::from_rect(Rect::from_xywh(
        single(area.left),
        single(area.top),
        single(area.width),
        single(area.height),
    )?);
    mask.fill_path(&path, FillRule::Winding, true, transform);
    Some(mask)
}

fn paint_path(
    pixmap: &mut Pixmap,
    path: &tiny_skia::Path,
    paint: &Paint,
    transform: Transform,
    mask: Option<&Mask>,
) {
    let of = |[r, g, b]: Rgb, opacity: f64| {
        let mut paint = tiny_skia::Paint::default();
        paint.set_color_rgba8(r, g, b, numbers::whole::<u8>((opacity * 255.0).round()));
        paint
    };
    if let Some((colour, opacity)) = paint.fill {
        pixmap.fill_path(path, &of(colour, opacity), FillRule::Winding, transform, mask);
    }
    if let Some((colour, width)) = paint.stroke {
        let stroke = Stroke {
            width: single(width),
            line_cap: LineCap::Butt,
            line_join: LineJoin::Round,
            dash: paint.dash.and_then(|d| StrokeDash::new(vec![single(d), single(d)], 0.0)),
            ..Stroke::default()
        };
        pixmap.stroke_path(path, &of(colour, 1.0), &stroke, transform, mask);
    }
}

/// Every pixel of the picture takes the colour of the block that its centre lies in; where
/// blocks are smaller than pixels, the mean of those that it covers.
fn blocks(pixmap: &mut Pixmap, area: Area, columns: usize, pixels: &[Rgb], scale: f64) {
    let rows = pixels.len() / columns.max(1);
    if rows == 0 {
        return;
    }
    let [left, top] = [area.left * scale, area.top * scale].map(f64::round);
    let [width, height] = [area.width * scale, area.height * scale].map(f64::round);
    let span = |at: f64, size: f64, count: usize| {
        let first = numbers::whole::<usize>((at / size * count as f64 + 1e-9).floor());
        let last = numbers::whole::<usize>(((at + 1.0) / size * count as f64 - 1e-9).ceil());
        let (first, last) = (first.min(count - 1), last.clamp(1, count));
        match count as f64 > size {
            true => first..last.max(first + 1),
            false => {
                let centre = numbers::whole::<usize>(((at + 0.5) / size * count as f64).floor());
                centre.min(count - 1)..centre.min(count - 1) + 1
            }
        }
    };
    let stride = pixmap.width() as usize;
    let (across, down) = (stride as f64 - left, f64::from(pixmap.height()) - top);
    for y in 0..numbers::whole::<usize>(height.min(down)) {
        let of_rows = span(y as f64, height, rows);
        for x in 0..numbers::whole::<usize>(width.min(across)) {
            let mut sum = [0_u32; 3];
            let of_columns = span(x as f64, width, columns);
            for row in of_rows.clone() {
                for pixel in
                    &pixels[row * columns + of_columns.start..row * columns + of_columns.end]
                {
                    (0..3).for_each(|i| sum[i] += u32::from(pixel[i]));
                }
            }
            let count = numbers::count(of_rows.len() * of_columns.len());
            let [r, g, b] = sum.map(|sum| numbers::narrow::<u8>((sum + count / 2) / count));
            if let Some(colour) = PremultipliedColorU8::from_rgba(r, g, b, 255) {
                pixmap.pixels_mut()[(numbers::whole::<usize>(top) + y) * stride
                    + numbers::whole::<usize>(left)
                    + x] = colour;
            }
        }
    }
}
