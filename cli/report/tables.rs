//! Tables about a run: counts, provenance, retrieval, the resolved scene.

use crate::failure::Failure;
use crate::picture::text::short;
use crate::subject::Subject;
use beamlet::cli_support::count;
use beamlet::retrieve::ViewCorrection;
use beamlet::stack::layout;
use beamlet::{AuditedError, SamplingError, SamplingSummary};
use serde_json::Value;

/// The run in one line.
pub(super) fn summary(run: &Subject) -> String {
    let Some(file) = run.run() else {
        let [views, _, rows, columns] = run.shape();
        let version = run.record().map_or("", |record| record.version.as_str());
        return format!(
            "retrieved images · views {views} · pixels {columns} × {rows} · beamlet {version}"
        );
    };
    let record = file.record();
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
pub(super) fn scene_text(run: &Subject) -> Result<String, Failure> {
    let Some(file) = run.run() else {
        let geometry = run.record().and_then(|record| record.geometry.clone());
        return Ok(geometry.unwrap_or_default());
    };
    let path = file.path().join(layout::SCENE);
    std::fs::read_to_string(&path)
        .map_err(|error| Failure::File { path, problem: format!("cannot be read: {error}") })
}

/// A line of a table: name, value, whether it is highlighted, and the meaning of the name.
#[derive(Debug, Clone, Default)]
pub(super) struct TableRow {
    key: String,
    value: String,
    marked: bool,
    meaning: String,
}

impl TableRow {
    pub(super) fn new(key: impl Into<String>, value: impl Into<String>) -> Self {
        Self { key: key.into(), value: value.into(), ..Self::default() }
    }

    pub(super) const fn marked(mut self, marked: bool) -> Self {
        self.marked = marked;
        self
    }

    fn meaning(mut self, meaning: &str) -> Self {
        self.meaning = meaning.to_owned();
        self
    }
}

impl From<TableRow> for minijinja::Value {
    fn from(TableRow { key, value, marked, meaning }: TableRow) -> Self {
        minijinja::context! { key, value, marked, meaning }
    }
}

/// Meanings of the words of the page.
const WORDS: [(&str, &str); 8] = [
    (
        "T, transmission",
        "fraction of the light that the sample transmits: the area of its illumination curve over the area of the flat's. 1 is the empty beam.",
    ),
    (
        "α, refraction angle",
        "mean angle by which the sample deflects the beam, in µrad; positive towards +x. It is the \
         shift of the curve times the mask magnification divided by the lever arm, with opposite sign.",
    ),
    (
        "σ_DF², dark field",
        "variance of the angles within a pixel, in µrad²: how much broader the curve is with the \
         sample. Noise, and curves of another shape than the fit, can make it negative.",
    ),
    (
        "1 (intensity)",
        "the light of an open pixel: no masks, no sample. Masks transmit a fraction of it.",
    ),
    (
        "1σ",
        "one standard deviation of the noise of counts. Noise-free intensities have none; the rms \
         residual, a fraction of the open beam, shows the quality of their fits.",
    ),
    ("residual", "data − fit; the rms residual is its root mean square over the mask steps."),
    (
        "flags",
        "reasons to distrust the values of a pixel. Misfit: its contrasts do not continue those of its \
         neighbours, for example where the silhouette of an object crosses it. Flagged pixels do not set the colour \
         scales; pixels without a result are violet.",
    ),
    (
        "A, µ, σ, b",
        "height, centre, standard deviation and background of what is fitted to a curve over the mask offset f: \
         the curve of the masks (exact-curve), or the Gaussian A exp(−(f − µ)² / 2σ²) + b.",
    ),
];

/// Terms with their meanings.
pub(super) fn words() -> Vec<TableRow> {
    WORDS.iter().map(|(term, meaning)| TableRow::new(*term, *meaning)).collect()
}

/// Meanings of the counts of a tally.
const MEANINGS: [(&str, &str); 14] = [
    ("rays", "traced as straight lines, with refraction to first order"),
    ("exact", "traced exactly, surface by surface, because they graze a surface"),
    ("unbalanced", "rays that entered and left some object unequally often; should be 0"),
    ("negative", "rays with a negative path in a material, by objects with defects; should be 0"),
    (
        "unordered",
        "rays that could not be followed exactly and keep their first order; should be 0",
    ),
    ("retraced", "rays of the ray-query backend that the software BVH has traced again"),
    ("dropped", "rectangles or crossings beyond a limit; should be 0"),
    ("reflected", "rays that were totally reflected at least once; by waves at each energy"),
    (
        "grazing_light",
        "by waves: light that crosses surfaces near grazing, summed over patches in 1e-9 of the light of one",
    ),
    ("not_finite", "rays whose value is not a number; their light is omitted; should be 0"),
    (
        "landed_off",
        "rectangles whose light lands outside the detector or too far off to follow; by waves it stays in its row",
    ),
    ("defective_objects", "objects with open or crossing surfaces, accepted by allow_defects"),
    ("saturated", "detector numbers clipped at the upper end of the bit depth"),
    ("clipped_at_zero", "detector numbers clipped at 0; should be 0"),
];

/// Counts that belong to any run.
const USUAL: [&str; 4] = ["rays", "exact", "reflected", "grazing_light"];

/// Counts of sampling, as text.
const OF_SAMPLING: [&str; 8] = [
    "audit",
    "patches",
    "lines",
    "patch_rays",
    "most_patch_rays",
    "error_squares",
    "worst_error",
    "beyond_tolerance",
];

/// The counts of the run; unexpected ones are highlighted.
pub(super) fn tally(run: &Subject) -> Vec<TableRow> {
    let Some(file) = run.run() else { return Vec::new() };
    let record = &file.record().record;
    let value = serde_json::to_value(record.tally).unwrap_or(Value::Null);
    let counts = value.as_object().into_iter().flatten();
    let rows =
        counts.filter(|(key, _)| !OF_SAMPLING.contains(&key.as_str())).map(|(key, value)| {
            let number = value.as_u64().unwrap_or(0);
            let meaning = MEANINGS.iter().find(|(name, _)| name == key);
            TableRow::new(key.replace('_', " "), count(number))
                .marked(number > 0 && !USUAL.contains(&key.as_str()))
                .meaning(meaning.map_or("", |(_, meaning)| meaning))
        });
    let of_sampling = record.sampling.iter().flat_map(sampling);
    rows.chain(of_sampling).chain(record.sampling_error.iter().map(audited)).collect()
}

/// Measured error of sampling.
fn audited(error: &SamplingError) -> TableRow {
    let AuditedError { rms, standard_error, patches, .. } = error.all;
    let value = format!("{rms:.1e} of open beam (rms, standard error {standard_error:.1e})");
    TableRow::new("measured error of sampling", value)
        .meaning(&format!("{} beamlets and rows compared with rays of their own", count(patches)))
}

/// Rays and estimated errors of sampling.
fn sampling(summary: &SamplingSummary) -> [TableRow; 3] {
    let SamplingSummary { patches, mean_rays, most_rays, rms_error, worst_error, .. } = summary;
    let beyond = summary.beyond_tolerance;
    [
        TableRow::new(
            "rays per beamlet and row with sample",
            format!("{mean_rays:.1}, at most {}", count(*most_rays)),
        ),
        TableRow::new(
            "estimated error of sampling",
            format!("{rms_error:.1e} of open beam (rms), {worst_error:.1e} (worst)"),
        ),
        TableRow::new(
            format!(
                "beamlets and rows that may miss a tolerance, {:.1e} of open beam or the tolerance of angles",
                summary.tolerance
            ),
            format!("{} of {}", count(beyond), count(*patches)),
        )
        .marked(beyond > 0),
    ]
}

/// Version, device, driver, backend, seed, seconds.
pub(super) fn provenance(run: &Subject) -> Vec<TableRow> {
    let mut rows =
        vec![TableRow::new("directory", beamlet::cli_support::printed::path(run.path()))];
    let Some(file) = run.run().map(|run| run.record()) else {
        if let Some(record) = run.record() {
            rows.push(TableRow::new("retrieved from", record.sources.join(", ")));
            let dark = record.dark.clone().unwrap_or_else(|| "none".into());
            rows.push(TableRow::new("dark frames", dark));
        }
        return rows;
    };
    let record = &file.record;
    let state = serde_json::to_value(file.state).unwrap_or(Value::Null);
    for (key, value) in [
        ("state", state.as_str().unwrap_or_default().to_owned()),
        ("version", record.version.clone()),
        ("device", record.device.clone()),
        ("driver", record.driver.clone()),
        ("backend", format!("{}: {}", record.backend, record.backend_reason)),
        ("seed", record.seed.to_string()),
    ] {
        rows.push(TableRow::new(key, value));
    }
    if let Some(search) = &record.search {
        let crossings = short(search.crossings_per_ray);
        let value =
            format!("{} leaves, {crossings} crossings per ray", count(search.leaves.into()));
        rows.push(TableRow::new("search", value));
    }
    let seconds: Vec<String> =
        record.seconds.iter().map(|(what, time)| format!("{what} {time:.1}")).collect();
    rows.push(TableRow::new("seconds", seconds.join(", ")));
    rows
}

/// How the run was retrieved; nothing where it is not.
pub(super) fn retrieval(run: &Subject) -> Vec<TableRow> {
    let Some(record) = run.record() else { return Vec::new() };
    let pixels: usize = record.shape.iter().product();
    let values = if record.counts { "counts" } else { "intensities" };
    let mut rows = vec![
        TableRow::new("method", record.method.clone()),
        TableRow::new("version", record.version.clone()),
        TableRow::new("values", values),
        TableRow::new("weights", record.weights.clone()),
        TableRow::new("mask magnification M", short(record.magnification)),
        TableRow::new("lever arm z", format!("{} m", short(record.lever_arm))),
        TableRow::new("angle per shift", format!("{} rad/m", short(record.angle_per_shift))),
    ];
    if let Some(background) = &record.background {
        rows.push(TableRow::new("background", background.clone()));
    }
    if let Some(response) = &record.response {
        let value = format!("{response} (retrieved over true)");
        rows.push(TableRow::new("small contrasts", value).marked(response.is_poor()));
    }
    let (lost, all) = (count(record.without_answer), count(pixels as u64));
    rows.push(
        TableRow::new("without a result", format!("{lost} of {all} pixels"))
            .marked(record.without_answer > 0),
    );
    rows.extend(corrections(record));
    for (bit, number) in record.flagged.iter().filter(|(_, number)| **number > 0) {
        let value = format!("{}: {number} pixels", run.flag_words(*bit));
        rows.push(TableRow::new("flag", value).marked(true));
    }
    rows
}

/// Corrections by empty beam: least and greatest value over views and frames, with the largest uncertainty.
fn corrections(record: &beamlet::retrieve::Record) -> Vec<TableRow> {
    let views = &record.corrections;
    let frames = |of: fn(&ViewCorrection) -> &Vec<Option<[f64; 2]>>| -> Vec<Option<[f64; 2]>> {
        views.iter().flat_map(|view| of(view).iter().copied()).collect()
    };
    let of = |key: &str, scale: f64, unit: &str, values: Vec<Option<[f64; 2]>>| {
        let known: Vec<[f64; 2]> = values.iter().copied().flatten().collect();
        let first = known.first()?;
        let ends = known
            .iter()
            .fold([first[0]; 2], |[low, high], [value, _]| [low.min(*value), high.max(*value)]);
        let [low, high] = ends.map(|end| short(scale * end));
        let sigma = short(scale * known.iter().map(|pair| pair[1]).fold(0.0, f64::max));
        let unknown = values.len() - known.len();
        let more = if unknown > 0 { format!(", {unknown} unknown") } else { String::new() };
        Some(
            TableRow::new(key, format!("{low} to {high} {unit} (± {sigma}){more}"))
                .marked(unknown > 0),
        )
    };
    [
        of("dose of frames", 1.0, "of the flat's", frames(|view| &view.dose)),
        of("displacement of frames", 1e6, "µm", frames(|view| &view.steps)),
        of(
            "α subtracted",
            1e6,
            "µrad",
            views.iter().filter_map(|view| view.offset).map(Some).collect(),
        ),
        of("displacement of frames along z", 1e6, "µm", frames(|view| &view.steps_z)),
        of(
            "α along z subtracted",
            1e6,
            "µrad",
            views.iter().filter_map(|view| view.offset_z).map(Some).collect(),
        ),
    ]
    .into_iter()
    .flatten()
    .collect()
}
