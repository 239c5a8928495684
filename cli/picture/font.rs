//! The one typeface of all pictures, inside the program: `DejaVu Sans` (licence beside it).

use crate::numbers::single;
use ab_glyph::{Font, FontRef, OutlineCurve, PxScale, ScaleFont};
use std::sync::LazyLock;
use tiny_skia::{Path, PathBuilder};

static TYPEFACE: LazyLock<Option<FontRef<'static>>> =
    LazyLock::new(|| FontRef::try_from_slice(include_bytes!("font/DejaVuSans.ttf")).ok());

/// Size of the em at a type size: `ab_glyph` scales by the height of a line.
fn scale_of(font: &FontRef<'_>, size: f64) -> PxScale {
    let em = font.units_per_em().unwrap_or(2048.0);
    PxScale::from(single(size) * font.height_unscaled() / em)
}

/// Width of a text, in pixels.
pub(super) fn width(text: &str, size: f64) -> f64 {
    let mut end = 0.0;
    if let Some(font) = &*TYPEFACE {
        let scaled = font.as_scaled(scale_of(font, size));
        each(text, &scaled, |_, x, advance| end = x + advance);
    }
    f64::from(end)
}

/// Outline of a text that begins at the origin on its base line.
pub(super) fn outline(text: &str, size: f64) -> Option<Path> {
    let font = TYPEFACE.as_ref()?;
    let scale = scale_of(font, size);
    let scaled = font.as_scaled(scale);
    let factor = scaled.h_scale_factor();
    let mut builder = PathBuilder::new();
    each(text, &scaled, |glyph, x, _| {
        let Some(outline) = font.outline(glyph) else { return };
        let at = |point: ab_glyph::Point| (x + point.x * factor, -point.y * factor);
        let mut end = None;
        for curve in outline.curves {
            let (first, last) = match curve {
                OutlineCurve::Line(a, b)
                | OutlineCurve::Quad(a, _, b)
                | OutlineCurve::Cubic(a, _, _, b) => (at(a), at(b)),
            };
            if end != Some(first) {
                builder.move_to(first.0, first.1);
            }
            match curve {
                OutlineCurve::Line(..) => builder.line_to(last.0, last.1),
                OutlineCurve::Quad(_, b, _) => {
                    let b = at(b);
                    builder.quad_to(b.0, b.1, last.0, last.1);
                }
                OutlineCurve::Cubic(_, b, c, _) => {
                    let (b, c) = (at(b), at(c));
                    builder.cubic_to(b.0, b.1, c.0, c.1, last.0, last.1);
                }
            }
            end = Some(last);
        }
        builder.close();
    });
    builder.finish()
}

/// Calls `visit` with every glyph, where it begins and how wide it is.
fn each<'a>(
    text: &str,
    scaled: &ab_glyph::PxScaleFont<&FontRef<'a>>,
    mut visit: impl FnMut(ab_glyph::GlyphId, f32, f32),
) {
    let (mut x, mut before) = (0.0, None);
    for letter in text.chars() {
        let glyph = scaled.glyph_id(letter);
        if let Some(before) = before {
            x += scaled.kern(before, glyph);
        }
        let advance = scaled.h_advance(glyph);
        visit(glyph, x, advance);
        x += advance;
        before = Some(glyph);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sign_of_the_charts_is_in_the_typeface() {
        let font = TYPEFACE.as_ref().unwrap();
        for letter in "µ²σαθδ±·×−–°≥≤→↑Δ₁₂⁻⁷".chars() {
            assert_ne!(font.glyph_id(letter).0, 0, "{letter}");
        }
        // A capital H of DejaVu Sans is 1540 of 2048 units wide.
        assert!((width("H", 20.48) - 15.4).abs() < 0.01, "{}", width("H", 20.48));
    }
}
