//! A drawing as SVG, for pages.

use super::colour::Rgb;
use super::drawing::{Anchor, Area, Drawing, Item, Paint};
use std::fmt::Write as _;

impl Drawing {
    /// The drawing as an `<svg>` element that scales with its place in the page.
    pub(crate) fn to_svg(&self) -> String {
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" \
             font-family=\"DejaVu Sans, Verdana, sans-serif\">\n",
            self.width, self.height
        );
        for (index, item) in self.items.iter().enumerate() {
            // Writing to a string does not fail.
            let _ = write_item(&mut out, index, item);
        }
        out + "</svg>\n"
    }
}

fn write_item(out: &mut String, index: usize, item: &Item) -> std::fmt::Result {
    match item {
        Item::Path { points, closed, paint, clip } => {
            let mut clipped = String::new();
            if let Some(Area { left, top, width, height }) = clip {
                writeln!(
                    out,
                    "<clipPath id=\"clip{index}\"><rect x=\"{left:.2}\" y=\"{top:.2}\" \
                     width=\"{width:.2}\" height=\"{height:.2}\"/></clipPath>"
                )?;
                clipped = format!(" clip-path=\"url(#clip{index})\"");
            }
            let name = if *closed { "polygon" } else { "polyline" };
            write!(out, "<{name} points=\"")?;
            for [x, y] in points {
                write!(out, "{x:.2},{y:.2} ")?;
            }
            writeln!(out, "\"{}{clipped}/>", style(paint))
        }
        Item::Disc { at: [x, y], radius, paint } => {
            let style = style(paint);
            writeln!(out, "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{radius:.2}\"{style}/>")
        }
        Item::Text { at: [x, y], text, size, colour, anchor, upwards } => {
            let anchor = match anchor {
                Anchor::Start => "start",
                Anchor::Middle => "middle",
                Anchor::End => "end",
            };
            let turned = match upwards {
                true => format!(" transform=\"rotate(-90 {x:.2} {y:.2})\""),
                false => String::new(),
            };
            writeln!(
                out,
                "<text x=\"{x:.2}\" y=\"{y:.2}\" font-size=\"{size}\" fill=\"{}\" \
                 text-anchor=\"{anchor}\"{turned}>{}</text>",
                hex(*colour),
                escaped(text)
            )
        }
        // The page draws its images itself.
        Item::Pixels { area, columns, pixels } => {
            let rows = pixels.len() / (*columns).max(1);
            let (width, height) = (area.width / *columns as f64, area.height / rows.max(1) as f64);
            for (index, colour) in pixels.iter().enumerate() {
                writeln!(
                    out,
                    "<rect x=\"{:.2}\" y=\"{:.2}\" width=\"{width:.2}\" height=\"{height:.2}\" \
                     fill=\"{}\"/>",
                    area.left + (index % columns) as f64 * width,
                    area.top + (index / columns) as f64 * height,
                    hex(*colour)
                )?;
            }
            Ok(())
        }
    }
}

fn style(paint: &Paint) -> String {
    let mut style = match paint.fill {
        Some((colour, opacity)) => {
            format!(" fill=\"{}\" fill-opacity=\"{opacity:.3}\"", hex(colour))
        }
        None => " fill=\"none\"".into(),
    };
    if let Some((colour, width)) = paint.stroke {
        style += &format!(
            " stroke=\"{}\" stroke-width=\"{width}\" stroke-linejoin=\"round\"",
            hex(colour)
        );
    }
    if let Some(dash) = paint.dash {
        style += &format!(" stroke-dasharray=\"{dash} {dash}\"");
    }
    style
}

fn hex([r, g, b]: Rgb) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// Text as HTML and SVG take it.
pub(crate) fn escaped(text: &str) -> String {
    let text = beamlet::printed::lines(text);
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
