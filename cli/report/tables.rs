//! What is known of a run, as tables: counts, provenance, retrieval, the resolved scene.

use crate::failure::Failure;
use crate::picture::svg::escaped;
use crate::picture::text::{count, short};
use crate::run_reader::RunReader;
use serde_json::Value;
use std::fmt::Write as _;

/// The run in one line.
pub(super) fn summary(run: &RunReader) -> String {
    let record = run.run().record();
    let extent = record.extent;
    let committed = match run.views() {
        views if views == extent.views as usize => views.to_string(),
        views => format!("{views} (of {} asked for)", extent.views),
    };
    let record = &record.record;
    format!(
        "views {committed} · mask steps {} · pixels {} × {} · beamlet {} · {} ({})",
        extent.steps, extent.columns, extent.rows, record.version, record.device, record.backend
    )
}

/// scene.toml of the run.
pub(super) fn scene_text(run: &RunReader) -> Result<String, Failure> {
    let path = run.run().path().join("scene.toml");
    std::fs::read_to_string(&path)
        .map_err(|error| Failure::File { path, problem: format!("cannot be read: {error}") })
}

/// The counts of the run; those that are not zero stand out.
pub(super) fn tally(run: &RunReader) -> String {
    let value = serde_json::to_value(run.run().record().record.tally).unwrap_or(Value::Null);
    let rows = value.as_object().into_iter().flatten().map(|(key, value)| {
        let number = value.as_u64().unwrap_or(0);
        let text = count(usize::try_from(number).unwrap_or(usize::MAX));
        (key.replace('_', " "), text, number > 0 && key != "rays")
    });
    table(rows)
}

/// Version, device, driver, backend, seed, seconds.
pub(super) fn provenance(run: &RunReader) -> String {
    let file = run.run().record();
    let record = &file.record;
    let state = serde_json::to_value(file.state).unwrap_or(Value::Null);
    let mut rows = vec![
        ("directory", run.run().path().display().to_string()),
        ("state", state.as_str().unwrap_or_default().to_owned()),
        ("version", record.version.clone()),
        ("device", record.device.clone()),
        ("driver", record.driver.clone()),
        ("backend", format!("{}: {}", record.backend, record.backend_reason)),
        ("seed", record.seed.to_string()),
    ];
    for (what, rate) in &record.calibration {
        rows.push(("calibration", format!("{what} {} million rays a second", short(*rate))));
    }
    let seconds: Vec<String> =
        record.seconds.iter().map(|(what, time)| format!("{what} {time:.1}")).collect();
    rows.push(("seconds", seconds.join(", ")));
    table(rows.into_iter().map(|(key, value)| (key.to_owned(), value, false)))
}

/// retrieved.json.
pub(super) fn retrieval(run: &RunReader) -> String {
    let rows = run.record().as_object().into_iter().flatten().map(|(key, value)| {
        let text = match value {
            Value::String(text) => text.clone(),
            Value::Object(map) => {
                let parts = map.iter().map(|(key, value)| match value {
                    Value::String(text) => format!("{key}: {text}"),
                    other => format!("{key}: {other}"),
                });
                parts.collect::<Vec<_>>().join("; ")
            }
            other => other.to_string(),
        };
        (key.replace('_', " "), text, false)
    });
    match run.record().is_null() {
        true => "<p class=\"note\">The run is not retrieved.</p>".into(),
        false => table(rows),
    }
}

fn table(rows: impl Iterator<Item = (String, String, bool)>) -> String {
    let mut out = String::from("<table>\n");
    for (key, value, marked) in rows {
        let class = if marked { " class=\"marked\"" } else { "" };
        // Writing to a string does not fail.
        let _ =
            writeln!(out, "<tr{class}><th>{}</th><td>{}</td></tr>", escaped(&key), escaped(&value));
    }
    out + "</table>\n"
}
