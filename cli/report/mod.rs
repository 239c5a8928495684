//! A run, or a reconstruction, as one page for a browser: data, drawing code and style in a single file
//! without requests to any server.

mod data;
mod figures;
mod tables;
mod thinning;
mod volume;

use crate::failure::Failure;
use crate::numbers;
use crate::picture::colour::Map;
use crate::progress::Reporter;
use crate::subject::Subject;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use beamlet::cli_support::{printed, require_memory};
use minijinja::{Environment, UndefinedBehavior, Value, context, escape_formatter};
use std::path::Path;
use std::time::SystemTime;
use tables::TableRow;
pub(crate) use volume::page as volume_page;

/// Images of a view beside its steps: retrieved ones with their 1 sigma, flags, the parts of a fit, its
/// residual.
const IMAGES: u64 = 13;
/// Bytes that a page takes while it is made, for each of its image data: values before they are 16
/// bits, the bits, their text, and two copies of that while it grows.
const COPIES: u64 = 14;
/// Bytes for each pixel of a frame that is read and binned.
const OF_FRAME: u64 = 32;

/// Common beginning and end of the pages.
const HEAD: &str = include_str!("page/head.html");
const FOOT: &str = include_str!("page/foot.html");
const STYLE: &str = include_str!("page/page.css");
const SHARED: [&str; 3] =
    [include_str!("page/common.js"), include_str!("page/axes.js"), include_str!("page/charts.js")];
/// The part of a page that is its own, and its scripts.
#[derive(Debug, Clone, Copy)]
struct Page {
    body: &'static str,
    scripts: &'static [&'static str],
}

/// The page of a run.
const RUN: Page = Page {
    body: include_str!("page/run.html"),
    scripts: &[
        include_str!("page/state.js"),
        include_str!("page/images.js"),
        include_str!("page/curves.js"),
        include_str!("page/sinograms.js"),
        include_str!("page/controls.js"),
    ],
};
/// uPlot from npm; its version, hashes and licence lie beside it.
const CHARTS: &str = include_str!("uplot/uPlot.iife.min.js");
const CHART_STYLE: &str = include_str!("uplot/uPlot.min.css");

/// Options of a page.
#[derive(Debug, Clone, Default)]
pub(crate) struct PageOptions {
    /// Most bytes of image data.
    pub(crate) most: u64,
    /// Vulkan device that draws the sample.
    pub(crate) device: Option<String>,
    /// The command line that made the page.
    pub(crate) command: String,
}

/// The page of a run or of retrieved images.
///
/// Fails where there is not the memory for it.
pub(crate) fn page(
    run: &Subject,
    options: &PageOptions,
    reporter: &mut Reporter,
) -> Result<String, Failure> {
    let most = options.most;
    let [views, steps, rows, columns] = run.shape().map(|side| side as u64);
    let frame = rows.saturating_mul(columns);
    let images = (views + 1).saturating_mul(steps + IMAGES).saturating_mul(2 * frame).min(most);
    let needed = COPIES.saturating_mul(images).saturating_add(OF_FRAME.saturating_mul(frame));
    require_memory(needed, "the page of a report")?;
    reporter.doing("reading images");
    let data = data::collect(run, most)?;
    let arrays: Vec<TableRow> = data.arrays.into_iter().map(encoded).collect();
    let figures = figures::of(run, options.device.as_deref(), reporter)?;
    let notes: Vec<String> = data.notes.into_iter().chain(figures.notes).collect();
    let has_noise = run.sigma_of("transmission").is_some();
    let context = context! {
        title => title(run),
        summary => tables::summary(run),
        facts => facts(run, &options.command),
        notes,
        frames => run.has_fitted(),
        words => tables::words(),
        band => if has_noise { "± 1σ" } else { "" },
        set_up => figures.set_up,
        sample => figures.sample,
        spectrum => figures.spectrum,
        energy => figures.energy,
        limits => figures.limits,
        provenance => tables::provenance(run),
        retrieval => tables::retrieval(run),
        tally => tables::tally(run),
        scene => tables::scene_text(run)?,
        meta => script_json(&data.meta)?,
        arrays,
    };
    rendered(RUN, context)
}

/// An array as base64 of 16-bit numbers.
fn encoded((name, words): (String, Vec<u16>)) -> TableRow {
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    TableRow::new(name, STANDARD.encode(bytes))
}

/// Fills a page; what is put in is escaped, but for what the page calls safe.
fn rendered(page: Page, context: Value) -> Result<String, Failure> {
    let scripts: String = SHARED.iter().chain(page.scripts).copied().collect();
    let context = context! {
        style => STYLE,
        chart_style => CHART_STYLE,
        charts => CHARTS,
        script => scripts,
        ..context
    };
    let text = [HEAD, page.body, FOOT].concat();
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
    environment.add_template("page.html", &text).map_err(failed)?;
    environment.get_template("page.html").and_then(|page| page.render(context)).map_err(failed)
}

/// The title of the scene, or the name of the directory.
fn title(run: &Subject) -> String {
    let title = run.title();
    if !title.is_empty() {
        return title;
    }
    name_of(run.path())
}

/// The name of a directory, of a path such as ".", too.
fn name_of(path: &Path) -> String {
    let whole = path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
    let name = whole.file_name().map(|name| name.to_string_lossy().into_owned());
    name.unwrap_or_else(|| "run".to_owned())
}

/// "2026-11-22T05:40:01Z" as people write it.
fn date(text: &str) -> String {
    text.replace('T', " ").replace('Z', " UTC")
}

/// Dates, commands and versions of the subject and the page.
fn facts(run: &Subject, command: &str) -> Vec<TableRow> {
    let mut facts = Vec::new();
    let mut add = |key: &str, value: String| facts.push(TableRow::new(key, value));
    if let Some(file) = run.run().map(|run| run.record()) {
        add("run", format!("{} to {}", date(&file.began), date(&file.written)));
        add("duration", words_of(file.duration_s));
        add("program", program(&file.record.version, file.record.commit.as_deref()));
        for command in &file.commands {
            add("command", command.clone());
        }
    }
    if let Some(record) = run.record() {
        let program = program(&record.version, record.commit.as_deref());
        let when = match &record.written {
            Some(written) => format!("{} in {}, ", date(written), words_of(record.duration_s)),
            None => String::new(),
        };
        add("retrieved", format!("{when}by {program}"));
        if let Some(command) = &record.command {
            add("retrieved by", command.clone());
        }
    }
    add("page written", date(&now()));
    add("by", command.to_owned());
    facts
}

fn now() -> String {
    humantime::format_rfc3339_seconds(SystemTime::now()).to_string()
}

/// A version of beamlet with the commit that it was built from.
fn program(version: &str, commit: Option<&str>) -> String {
    let commit = commit.map(|commit| format!(", commit {commit}"));
    format!("beamlet {version}{}", commit.unwrap_or_default())
}

/// A duration as people say it: 0.4 s, 2 min 05 s, 3 h 20 min.
fn words_of(seconds: f64) -> String {
    let whole = numbers::whole::<u64>(seconds.round());
    match whole {
        0..10 => format!("{seconds:.1} s"),
        10..60 => format!("{whole} s"),
        60..3600 => format!("{} min {:02} s", whole / 60, whole % 60),
        _ => format!("{} h {:02} min", whole / 3600, whole / 60 % 60),
    }
}

/// JSON for a script element.
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
