//! A drawing as SVG, for pages and files.

use super::colour::Rgb;
use super::drawing::{Anchor, Area, Drawing, Item, Paint};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use std::fmt::Write as _;

impl Drawing {
    /// The drawing as an `<svg>` element that scales with its place in a page. `name` is unique in the
    /// page; `label` describes it to screen readers.
    pub(crate) fn to_svg(&self, name: &str, label: &str) -> String {
        let role = format!("role=\"img\" aria-label=\"{}\"", escaped(label));
        self.as_svg(name, &role)
    }

    /// The drawing as an SVG file on white, of a width in pixels.
    pub(crate) fn to_svg_file(&self, width: f64) -> String {
        let height = width * self.height / self.width;
        let size = format!("width=\"{width:.0}\" height=\"{height:.0}\" style=\"background:#fff\"");
        self.as_svg("part", &size)
    }

    fn as_svg(&self, name: &str, attributes: &str) -> String {
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {:.2} {:.2}\" {attributes} \
             font-family=\"DejaVu Sans, Verdana, sans-serif\">\n",
            self.width, self.height
        );
        for (index, item) in self.items.iter().enumerate() {
            // Writing to a string does not fail.
            let _ = write_item(&mut out, &format!("{name}-{index}"), item);
        }
        out + "</svg>\n"
    }
}

fn write_item(out: &mut String, name: &str, item: &Item) -> std::fmt::Result {
    match item {
        Item::Path { points, closed, paint, clip } => {
            let mut clipped = String::new();
            if let Some(Area { left, top, width, height }) = clip {
                writeln!(
                    out,
                    "<clipPath id=\"{name}\"><rect x=\"{left:.2}\" y=\"{top:.2}\" \
                     width=\"{width:.2}\" height=\"{height:.2}\"/></clipPath>"
                )?;
                clipped = format!(" clip-path=\"url(#{name})\"");
            }
            let shape = if *closed { "polygon" } else { "polyline" };
            write!(out, "<{shape} points=\"")?;
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
        Item::Pixels { area: Area { left, top, width, height }, columns, pixels } => {
            let Some(png) = super::raster::block_as_png(*columns, pixels) else { return Ok(()) };
            writeln!(
                out,
                "<image x=\"{left:.2}\" y=\"{top:.2}\" width=\"{width:.2}\" \
                 height=\"{height:.2}\" preserveAspectRatio=\"none\" \
                 style=\"image-rendering:pixelated\" href=\"data:image/png;base64,{}\"/>",
                STANDARD.encode(png)
            )
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
    let text = beamlet::cli_support::printed::lines(text);
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
