//! Designs as CSV, and in words.

use beamlet::cli_support::printed::{number, with_unit};
use beamlet::sweep::{Results, Score};
use std::fmt::Write as _;

/// Columns of leaks and of the error of rays.
const LIMITS: [&str; 3] = [
    "leak of sample_mask [%]",
    "leak of detector_mask [%]",
    "ray_error of thin masks in closed form [% of peak]",
];

/// A design a line: number from 1, varied keys, photons and exposure of a frame, scores, visibility, leaks, error of rays, 1
/// on the Pareto front, and the reason of a refusal.
pub(super) fn csv(done: &Results<'_>) -> String {
    let scores = done.sweep.scores();
    let derived = !scores.contains(&Score::Photons);
    let has_exposure = done.outcomes.iter().any(|outcome| outcome.exposure.is_some());
    let mut header = vec!["design".to_owned()];
    header.extend(done.sweep.designs().keys().map(|key| with_unit(&key.path, &key.unit)));
    header.extend(derived.then(|| "photons".into()));
    header.extend(has_exposure.then(|| "exposure [s]".into()));
    header.extend(scores.iter().map(|score| with_unit(&score.name(), score.unit())));
    let has_visibility = scores.contains(&Score::Visibility);
    header.extend((!has_visibility).then(|| "visibility [%]".into()));
    header.extend(LIMITS.map(str::to_owned));
    header.extend((!done.front.is_empty()).then(|| "pareto".into()));
    header.push("refused".into());
    let mut out = line(&header);
    for (design, outcome) in done.outcomes.iter().enumerate() {
        let text = |value: Option<f64>| value.map(|value| format!("{value:?}")).unwrap_or_default();
        let mut cells = vec![(design + 1).to_string()];
        cells.extend(done.sweep.designs().values(design).into_iter().map(str::to_owned));
        cells.extend(derived.then(|| text(outcome.photons)));
        cells.extend(has_exposure.then(|| text(outcome.exposure)));
        let values = scores.iter().zip(&outcome.values);
        cells.extend(values.map(|(score, value)| text(value.map(|value| score.in_unit(value)))));
        let percent = |value: Option<f64>| text(value.map(|value| 100.0 * value));
        cells.extend((!has_visibility).then(|| percent(outcome.visibility)));
        cells.extend([0, 1].map(|mask| percent(outcome.leak.map(|leak| leak[mask]))));
        cells.push(percent(outcome.ray_error));
        cells.extend(done.front.get(design).map(|on_front| u8::from(*on_front).to_string()));
        cells.push(outcome.refused.clone().unwrap_or_default());
        out += &line(&cells);
    }
    out
}

/// A line of cells; those with separators are in quotes.
fn line(cells: &[String]) -> String {
    let cell = |text: &String| {
        let text = text.replace(['\n', '\r'], " ");
        match text.contains([',', ';', '"', '\t']) {
            true => format!("\"{}\"", text.replace('"', "\"\"")),
            false => text,
        }
    };
    cells.iter().map(cell).collect::<Vec<_>>().join(",") + "\n"
}

/// The best design in words: its score, its number and its keys.
pub(super) fn best(done: &Results<'_>, design: usize) -> String {
    let score = &done.sweep.scores()[0];
    let value = done.outcomes[design].values[0].map_or(f64::NAN, |value| score.in_unit(value));
    let mut text = format!("{} of {}", score.name(), number(value));
    if !score.unit().is_empty() {
        let _ = write!(text, " {}", score.unit());
    }
    let keys = done.sweep.designs().sets(design).join(", ");
    let _ = write!(text, ", design {}: {keys}", design + 1);
    text
}
