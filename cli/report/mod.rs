//! A run as one page for a browser: data, drawing code and style in a single file that asks for
//! nothing from anywhere.

mod data;
mod tables;

use crate::failure::Failure;
use crate::picture::colour::Map;
use crate::picture::set_up;
use crate::picture::svg::escaped;
use crate::run_reader::RunReader;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use beamlet::geometry::{self, Sample};
use beamlet::require_memory;
use std::fmt::Write as _;
use std::mem::take;

/// Images of a view beside its steps: retrieved ones, flags, the parts of a fit.
const IMAGES: u64 = 8;
/// Bytes that a page takes while it is made, for each of its image data: values before they are 16
/// bits, the bits, their text, and two copies of that while it grows.
const COPIES: u64 = 12;
/// Bytes for each pixel of a frame that is read and binned.
const OF_FRAME: u64 = 32;

const PAGE: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// The page of a run, with at most `most` bytes of image data.
///
/// Fails where there is not the memory for it.
pub(crate) fn page(run: &RunReader, most: u64) -> Result<String, Failure> {
    let [views, steps, rows, columns] = run.shape().map(|side| side as u64);
    let frame = rows.saturating_mul(columns);
    let images = (views + 1).saturating_mul(steps + IMAGES).saturating_mul(2 * frame).min(most);
    let needed = COPIES.saturating_mul(images).saturating_add(OF_FRAME.saturating_mul(frame));
    require_memory(needed, "the page of a report")?;
    let data = data::collect(run, most)?;
    let mut arrays = String::new();
    for (name, words) in &data.arrays {
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let text = STANDARD.encode(bytes);
        // Writing to a string does not fail.
        let _ = writeln!(arrays, "<script type=\"text/plain\" id=\"data-{name}\">{text}</script>");
    }
    let (sample, without) = match geometry::load(run.scene()) {
        Ok(sample) => (sample, String::new()),
        Err(error) => {
            let note = format!(
                "<p class=\"note\">Without the sample: {}</p>",
                escaped(&error.to_string())
            );
            (Sample::default(), note)
        }
    };
    let drawing = set_up::draw(run.scene(), &sample)?.to_svg() + &without;
    let name = run
        .run()
        .path()
        .file_name()
        .map_or_else(|| "run".to_owned(), |name| name.to_string_lossy().into_owned());
    let notes: String =
        data.notes.iter().map(|note| format!("<p class=\"note\">{}</p>", escaped(note))).collect();
    let meta = script_json(&data.meta)?;
    let mut content = Content { run, name, notes, drawing, meta, arrays };
    let mut parts = Vec::with_capacity(PARTS.len());
    for (mark, part) in PARTS {
        parts.push((mark, part(&mut content)?));
    }
    Ok(filled(PAGE, &parts))
}

/// What the parts of a page are made of.
struct Content<'a> {
    run: &'a RunReader,
    name: String,
    notes: String,
    drawing: String,
    meta: String,
    arrays: String,
}

/// Makes a part. Long ones are moved out of the content, not copied.
type PagePart = fn(&mut Content<'_>) -> Result<String, Failure>;

/// The marks of page.html and what stands in their place.
const PARTS: [(&str, PagePart); 12] = [
    ("{{title}}", |content| Ok(escaped(&content.name))),
    ("{{summary}}", |content| Ok(escaped(&tables::summary(content.run)))),
    ("{{notes}}", |content| Ok(take(&mut content.notes))),
    ("{{set-up}}", |content| Ok(take(&mut content.drawing))),
    ("{{scene}}", |content| Ok(escaped(&tables::scene_text(content.run)?))),
    ("{{tally}}", |content| Ok(tables::tally(content.run))),
    ("{{provenance}}", |content| Ok(tables::provenance(content.run))),
    ("{{retrieval}}", |content| Ok(tables::retrieval(content.run))),
    ("{{style}}", |_| Ok(STYLE.to_owned())),
    ("{{meta}}", |content| Ok(take(&mut content.meta))),
    ("{{arrays}}", |content| Ok(take(&mut content.arrays))),
    ("{{script}}", |_| Ok(SCRIPT.to_owned())),
];

/// Puts each part in the place of its mark. What is put in is not searched again.
fn filled(page: &str, parts: &[(&str, String)]) -> String {
    let mut out =
        String::with_capacity(page.len() + parts.iter().map(|(_, p)| p.len()).sum::<usize>());
    let mut rest = page;
    while let Some(start) = rest.find("{{") {
        out.push_str(&rest[..start]);
        rest = &rest[start..];
        match parts.iter().find(|(mark, _)| rest.starts_with(mark)) {
            Some((mark, part)) => {
                out.push_str(part);
                rest = &rest[mark.len()..];
            }
            None => {
                out.push_str("{{");
                rest = &rest[2..];
            }
        }
    }
    out + rest
}

/// JSON that may stand in a script element.
fn script_json(value: &serde_json::Value) -> Result<String, Failure> {
    let text = serde_json::to_string(value).map_err(std::io::Error::from)?;
    Ok(text.replace('<', "\\u003c"))
}

/// A colour map as 256 colours, base64.
fn table_of(map: Map) -> String {
    let colours: Vec<u8> = (0..256).flat_map(|i| map.colour(f64::from(i) / 255.0)).collect();
    STANDARD.encode(colours)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn what_is_put_in_is_not_searched_again() {
        let parts = [("{{a}}", "{{b}}".to_owned()), ("{{b}}", "x".to_owned())];
        assert_eq!(filled("1 {{a}} 2 {{b}} {{c}}", &parts), "1 {{b}} 2 x {{c}}");
    }

    #[test]
    fn json_cannot_end_its_script_element() {
        let value = serde_json::json!({ "name": "</script><b>" });
        let text = script_json(&value).unwrap();
        assert!(!text.contains('<'), "{text}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&text).unwrap(), value);
    }

    #[test]
    fn every_mark_of_the_page_is_known() {
        let marks: BTreeSet<&str> = PAGE
            .split("{{")
            .skip(1)
            .map(|rest| rest.split_once("}}").expect("a mark ends").0)
            .collect();
        let known = PARTS.map(|(mark, _)| mark.trim_matches(['{', '}']));
        assert_eq!(marks, BTreeSet::from(known));
    }
}
