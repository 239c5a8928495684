//! A run as one page for a browser: data, drawing code and style in a single file that asks for
//! nothing from anywhere.

mod data;
mod figures;
mod tables;
mod thinning;

use crate::failure::Failure;
use crate::picture::colour::Map;
use crate::subject::Subject;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use beamlet::{printed, require_memory};
use minijinja::{Environment, UndefinedBehavior, Value, context, escape_formatter};
use std::time::SystemTime;
use tables::TableRow;

/// Images of a view beside its steps: retrieved ones with their 1 sigma, flags, the parts of a
/// fit, what it leaves.
const IMAGES: u64 = 12;
/// Bytes that a page takes while it is made, for each of its image data: values before they are 16
/// bits, the bits, their text, and two copies of that while it grows.
const COPIES: u64 = 14;
/// Bytes for each pixel of a frame that is read and binned.
const OF_FRAME: u64 = 32;

const PAGE: &str = include_str!("page/page.html");
const STYLE: &str = include_str!("page/page.css");
const SCRIPTS: [&str; 4] = [
    include_str!("page/state.js"),
    include_str!("page/images.js"),
    include_str!("page/charts.js"),
    include_str!("page/controls.js"),
];
/// uPlot, as it comes from npm: version, hashes and licence stand beside it.
const CHARTS: &str = include_str!("uplot/uPlot.iife.min.js");
const CHART_STYLE: &str = include_str!("uplot/uPlot.min.css");

/// What a page is made with.
#[derive(Debug, Clone, Default)]
pub(crate) struct PageOptions {
    /// Most bytes of image data.
    pub(crate) most: u64,
    /// Vulkan device that draws the sample.
    pub(crate) device: Option<String>,
    /// The line that asked for the page.
    pub(crate) command: String,
}

/// The page of a run or of retrieved images.
///
/// Fails where there is not the memory for it.
pub(crate) fn page(run: &Subject, options: &PageOptions) -> Result<String, Failure> {
    let most = options.most;
    let [views, steps, rows, columns] = run.shape().map(|side| side as u64);
    let frame = rows.saturating_mul(columns);
    let images = (views + 1).saturating_mul(steps + IMAGES).saturating_mul(2 * frame).min(most);
    let needed = COPIES.saturating_mul(images).saturating_add(OF_FRAME.saturating_mul(frame));
    require_memory(needed, "the page of a report")?;
    let data = data::collect(run, most)?;
    let encoded = |(name, words): (String, Vec<u16>)| {
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        TableRow::new(name, STANDARD.encode(bytes))
    };
    let arrays: Vec<TableRow> = data.arrays.into_iter().map(encoded).collect();
    let figures = figures::of(run, options.device.as_deref())?;
    let notes: Vec<String> = data.notes.into_iter().chain(figures.notes).collect();
    let counts = run.record().is_some_and(|record| record.counts);
    let context = context! {
        title => title(run),
        summary => tables::summary(run),
        facts => facts(run, &options.command),
        notes,
        frames => run.has_fitted(),
        words => tables::words(),
        band => if counts { "± 1σ" } else { "± 1σ by the misfit of the fit" },
        set_up => figures.set_up,
        sample => figures.sample,
        spectrum => figures.spectrum,
        energy => figures.energy,
        provenance => tables::provenance(run),
        retrieval => tables::retrieval(run),
        tally => tables::tally(run),
        scene => tables::scene_text(run)?,
        meta => script_json(&data.meta)?,
        arrays,
        style => STYLE,
        chart_style => CHART_STYLE,
        charts => CHARTS,
        script => SCRIPTS.concat(),
    };
    rendered(&context)
}

/// Fills the page; what is put in is escaped, but for what the page calls safe.
fn rendered(context: &Value) -> Result<String, Failure> {
    let mut environment = Environment::new();
    environment.set_undefined_behavior(UndefinedBehavior::SemiStrict);
    // Characters that change how the text around them is shown stay out, too.
    environment.set_formatter(|out, state, value| match value.as_str() {
        Some(text) if !value.is_safe() && text.chars().any(printed::is_unsafe) => {
            escape_formatter(out, state, &Value::from(printed::lines(text)))
        }
        _ => escape_formatter(out, state, value),
    });
    let failed = |error: minijinja::Error| Failure::File {
        path: "page.html".into(),
        problem: format!("the page cannot be made: {error:#}"),
    };
    environment.add_template("page.html", PAGE).map_err(failed)?;
    environment.get_template("page.html").and_then(|page| page.render(context)).map_err(failed)
}

/// The name of the directory.
fn title(run: &Subject) -> String {
    let path = run.path();
    // Of a path such as ".", too.
    let whole = path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
    let name = whole.file_name().map(|name| name.to_string_lossy().into_owned());
    name.unwrap_or_else(|| "run".to_owned())
}

/// When what was made, and by which command.
fn facts(run: &Subject, command: &str) -> Vec<TableRow> {
    let time = |time: SystemTime| {
        let text = humantime::format_rfc3339_seconds(time).to_string();
        text.replace('T', " ").replace('Z', " UTC")
    };
    let written = |file: &str| {
        let found = run.path().join(file).metadata().and_then(|found| found.modified());
        found.ok().map(time)
    };
    let files = [("run.json", "run written"), ("retrieved.json", "images written")];
    let dates =
        files.into_iter().filter_map(|(file, key)| Some(TableRow::new(key, written(file)?)));
    let mut facts: Vec<TableRow> = dates.collect();
    facts.push(TableRow::new("page written", time(SystemTime::now())));
    facts.push(TableRow::new("by", command));
    facts
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
    use sha2::{Digest, Sha256};

    #[test]
    fn the_charts_are_those_of_the_package_that_is_named() {
        let named = include_str!("uplot/README.md");
        for (file, text) in [("uPlot.iife.min.js", CHARTS), ("uPlot.min.css", CHART_STYLE)] {
            let bytes = Sha256::digest(text.as_bytes());
            let hash: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
            assert!(named.contains(&format!("| SHA-256 of {file} | {hash} |")), "{file}: {hash}");
        }
        assert!(named.contains("1.6.32") && CHARTS.contains("(v1.6.32)"));
        assert!(include_str!("uplot/LICENSE").contains("The MIT License"));
    }

    #[test]
    fn json_cannot_end_its_script_element() {
        let value = serde_json::json!({ "name": "</script><b>" });
        let text = script_json(&value).unwrap();
        assert!(!text.contains('<'), "{text}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&text).unwrap(), value);
    }
}
