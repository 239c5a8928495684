//! What is known of a run, as tables: counts, provenance, retrieval, the resolved scene.

use crate::failure::Failure;
use crate::picture::svg::escaped;
use crate::picture::text::short;
use crate::run_reader::RunReader;
use beamlet::SamplingSummary;
use beamlet::check::count;
use serde_json::Value;
use std::fmt::Write as _;

/// The run in one line.
pub(super) fn summary(run: &RunReader) -> String {
    let record = run.run().record();
    let extent = record.extent;
    let committed = match run.views() {
        views if views == extent.views as usize => views.to_string(),
        views => format!("{views} (of {} requested)", extent.views),
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

/// Counts that belong to any run.
const USUAL: [&str; 4] = ["rays", "exact", "split", "reflected"];

/// Counts of sampling, as text.
const OF_SAMPLING: [&str; 6] = [
    "patches",
    "patch_rays",
    "most_patch_rays",
    "error_squares",
    "worst_error",
    "beyond_tolerance",
];

/// The counts of the run; those that should be zero and are not stand out.
pub(super) fn tally(run: &RunReader) -> String {
    let record = &run.run().record().record;
    let value = serde_json::to_value(record.tally).unwrap_or(Value::Null);
    let counts = value.as_object().into_iter().flatten();
    let rows =
        counts.filter(|(key, _)| !OF_SAMPLING.contains(&key.as_str())).map(|(key, value)| {
            let number = value.as_u64().unwrap_or(0);
            let text = count(number);
            (key.replace('_', " "), text, number > 0 && !USUAL.contains(&key.as_str()))
        });
    table(rows.chain(record.sampling.iter().flat_map(sampling)))
}

/// Rays and estimated errors of sampling.
fn sampling(summary: &SamplingSummary) -> Vec<(String, String, bool)> {
    let SamplingSummary { patches, mean_rays, most_rays, rms_error, worst_error, .. } = summary;
    let beyond = summary.beyond_tolerance;
    vec![
        (
            "rays per beamlet and row with sample".into(),
            format!("{mean_rays:.1}, at most {}", count(*most_rays)),
            false,
        ),
        (
            "estimated error of sampling".into(),
            format!("{rms_error:.1e} of open beam (rms), {worst_error:.1e} (worst)"),
            false,
        ),
        (
            format!("beamlets and rows that may miss the tolerance of {:.1e}", summary.tolerance),
            format!("{} of {}", count(beyond), count(*patches)),
            beyond > 0,
        ),
    ]
}

/// Version, device, driver, backend, seed, seconds.
pub(super) fn provenance(run: &RunReader) -> String {
    let file = run.run().record();
    let record = &file.record;
    let state = serde_json::to_value(file.state).unwrap_or(Value::Null);
    let mut rows = vec![
        ("directory", beamlet::printed::path(run.run().path())),
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

/// How the run was retrieved.
pub(super) fn retrieval(run: &RunReader) -> String {
    let Some(record) = run.record() else {
        return "<p class=\"note\">The run is not retrieved.</p>".into();
    };
    let pixels: usize = record.shape.iter().product();
    let mut rows = vec![
        ("method", record.method.clone(), false),
        ("version", record.version.clone(), false),
        ("values", if record.counts { "counts" } else { "intensities" }.to_owned(), false),
        ("weights", record.weights.clone(), false),
        ("mask magnification M", short(record.magnification), false),
        ("lever arm z", format!("{} m", short(record.lever_arm)), false),
        ("angle per shift", format!("{} rad/m", short(record.angle_per_shift)), false),
    ];
    let (lost, all) = (record.without_answer, count(pixels as u64));
    let lost = count(lost);
    let is_lost = record.without_answer > 0;
    rows.push(("without an answer", format!("{lost} of {all} pixels"), is_lost));
    for (bit, number) in record.flagged.iter().filter(|(_, number)| **number > 0) {
        rows.push(("flag", format!("{}: {number} pixels", run.flag_words(*bit)), true));
    }
    table(rows.into_iter().map(|(key, value, marked)| (key.to_owned(), value, marked)))
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
