//! Whole runs of tiny scenes with keys at the ends of their ranges: bytes choose the scene, some keys of the JSON
//! Schema, and a value of each. Of this file are a fuzz target and a test.

use beamlet::check::Check;
use beamlet::scene::Scene;
use beamlet::stack::ArraySink;
use beamlet::{Cancel, Control, Engine, EngineOptions, Error};
use serde_json::{Map, Value, json};
use std::sync::LazyLock;
use std::thread;
use std::time::Duration;

/// Longest time of a run before it is cancelled.
const PATIENCE: Duration = Duration::from_secs(2);
/// Memory of a run, bytes: the program and a run of a pixel take 267 MiB, by waves 427 MiB.
const MEMORY: u64 = 1 << 30;
/// Most keys that are changed.
const CHANGES: usize = 3;

/// Numbers of quantities.
const NUMBERS: [f64; 20] = [
    0.0, 1e-300, 1e-40, 1e-20, 1e-9, 1e-3, 0.1, 0.5, 0.999, 1.0, 2.0, 30.0, 100.0, 1e3, 1e6, 1e9,
    1e15, 1e20, 1e39, 1e300,
];
/// Names of materials, shapes, objects and files.
const NAMES: [&str; 8] = ["Al", "vacuum", "water", "gold", "ball", "um", "no.csv", "H2O"];

static SCHEMA: LazyLock<Value> = LazyLock::new(beamlet::cli_support::json_schema);

/// Bytes as choices; 0 where they end.
struct Choices<'a>(std::slice::Iter<'a, u8>);

impl Choices<'_> {
    /// A number below `count`.
    fn below(&mut self, count: usize) -> usize {
        let mut byte = || self.0.next().copied().map_or(0, usize::from);
        let number = if count > 256 { byte() << 8 | byte() } else { byte() };
        number % count.max(1)
    }

    fn of<'b, T>(&mut self, all: &'b [T]) -> &'b T {
        &all[self.below(all.len())]
    }
}

/// Bytes of a seed.
#[must_use]
pub fn drawn(seed: u64) -> Vec<u8> {
    let mut state = seed;
    let next = || {
        // splitmix64.
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)).to_le_bytes()
    };
    std::iter::repeat_with(next).take(16).flatten().collect()
}

/// An engine for tiny runs.
///
/// # Panics
/// Without a device.
#[must_use]
pub fn engine() -> Engine {
    let options = EngineOptions::default().with_memory_limit(Some(MEMORY));
    Engine::open(&options).expect("a Vulkan device")
}

/// Makes a scene of bytes and runs it; the JSON of the scene.
#[must_use]
pub fn scene_of(bytes: &[u8]) -> Value {
    let mut choices = Choices(bytes.iter());
    let mut scene = template(&mut choices);
    for _ in 0..choices.below(CHANGES + 1) {
        change(&mut choices, &mut scene, &SCHEMA);
    }
    scene
}

/// Checks and runs a scene; true if it ends with light. Errors are fine. What `check` accepts, a run does not refuse; and
/// light is finite.
///
/// # Panics
/// Where a property does not hold.
pub fn run(engine: &Engine, scene: &Value) -> bool {
    let Ok(mut scene) = Scene::from_json(&scene.to_string(), ".") else { return false };
    scene.detector.pixels = scene.detector.pixels.map(|count| count.min(2));
    let scan = &mut scene.scan;
    let frames = scan.mask_offsets.len().max(scan.poses());
    if frames > 12 || scene.validate().is_err() {
        return false;
    }
    scene.sampling.max_rays = scene.sampling.max_rays.min(500);
    let checked = Check::of(&scene).without_estimate().run_with(&mut control());
    let refuses = match checked {
        Ok(report) => !report.refusals.is_empty(),
        Err(_) => true,
    };
    let mut sink = ArraySink::new();
    let done = engine.run(&scene, &mut sink, control());
    match &done {
        Ok(_) => {
            let stacks = sink.into_stacks().expect("all frames");
            assert!(stacks.flat.iter().chain(&stacks.sample).all(|light| light.is_finite()));
        }
        Err(error @ Error::Scene { .. }) => assert!(refuses, "check accepts: {error}"),
        Err(_) => {}
    }
    done.is_ok()
}

/// A control that cancels a run which takes long.
fn control() -> Control<'static> {
    let cancel = Cancel::default();
    let late = cancel.clone();
    thread::spawn(move || {
        thread::sleep(PATIENCE);
        late.cancel();
    });
    Control::default().with_cancel(cancel)
}

/// A scene of a pixel and a ray.
fn template(choices: &mut Choices<'_>) -> Value {
    let ball =
        json!({ "name": "ball", "shape": { "sphere": { "radius": "60 um" } }, "material": "Al" });
    let mesh = json!({ "name": "ball", "shape": { "sphere": { "radius": "60 um", "sides": 8 } }, "material": "Al" });
    let mut scene = json!({
        "source": { "distance": "1.21 m", "spot": "20 um", "energy": "30 keV" },
        "detector": { "distance": "1.8 m", "pixels": [1, 1], "pitch": "150 um" },
        "sampling": { "rays": 1 },
        "object": [choices.of(&[ball, mesh])],
    });
    let slit = json!({ "distance": "1.2 m", "transmission": 0.0, "aperture": "20 um" });
    let rectangle = json!({
        "distance": "1.2 m", "transmission": 0.0, "shape": "rectangle", "aperture": "20 um", "period": "100 um",
        "aperture_z": "20 um", "period_z": "100 um"
    });
    let thick = json!({ "distance": "1.2 m", "material": "gold", "thickness": "50 um", "aperture": "20 um" });
    // Beside the beam, or beside a part of it.
    if choices.below(2) == 1 {
        let [x, z] = [["0 um", "100 um", "1 mm", "-5 mm"], ["0 um", "0 um", "100 um", "1 mm"]];
        scene["object"][0]["position"] = json!([choices.of(&x), "0 um", choices.of(&z)]);
    }
    match choices.below(6) {
        0 => {}
        1 => scene["sample_mask"] = rectangle,
        2 => scene["sample_mask"] = thick,
        _ => scene["sample_mask"] = slit,
    }
    if choices.below(2) == 1 && scene.get("sample_mask").is_some() {
        scene["detector_mask"] = json!({ "transmission": 0.0, "projected_aperture": "30 um" });
    }
    if choices.below(4) == 1 {
        scene["source"] = json!({
            "distance": "1.21 m", "spot": "20 um", "spectrum": { "anode": "tungsten", "kvp": "40 kV", "nodes": 2 }
        });
    }
    match choices.below(5) {
        0 => scene["sampling"]["scheme"] = "random".into(),
        1 => scene["sampling"]["transport"] = "exact".into(),
        2 | 3 => scene["sampling"]["transport"] = "wave".into(),
        _ => {}
    }
    scene
}

/// Goes down to a key of the schema and gives it another value.
fn change(choices: &mut Choices<'_>, at: &mut Value, schema: &Value) {
    let schema = one_form(choices, schema);
    let properties = schema.get("properties").and_then(Value::as_object);
    match (at, properties, schema.get("items")) {
        (Value::Array(all), _, Some(items)) if !all.is_empty() => {
            let index = choices.below(all.len());
            change(choices, &mut all[index], items);
        }
        (Value::Object(table), Some(properties), _) => {
            let is_used = |name: &&String| !["files", "title"].contains(&name.as_str());
            let names: Vec<&String> = properties.keys().filter(is_used).collect();
            let name = *choices.of(&names);
            change(choices, table.entry(name).or_insert(Value::Null), &properties[name]);
        }
        (at, ..) => *at = value(choices, schema),
    }
}

/// A form of a value that has several.
fn one_form<'a>(choices: &mut Choices<'_>, mut schema: &'a Value) -> &'a Value {
    while let Some(forms) = schema.get("anyOf").and_then(Value::as_array) {
        schema = choices.of(forms);
    }
    schema
}

/// A value that the schema allows, or nearly.
fn value(choices: &mut Choices<'_>, schema: &Value) -> Value {
    let schema = one_form(choices, schema);
    let number = |key: &str| schema.get(key).and_then(Value::as_f64);
    if let Some(words) = schema.get("enum").and_then(Value::as_array) {
        return choices.of(words).clone();
    }
    match schema.get("type").and_then(Value::as_str) {
        Some("integer") => {
            let [low, high] =
                ["minimum", "maximum"].map(|key| schema.get(key).and_then(Value::as_u64));
            let (low, high) = (low.unwrap_or(0), high.unwrap_or(u64::MAX));
            (*choices.of(&[low, low + 1, low + 2, high / 2, high])).into()
        }
        Some("number") => {
            let ends = [number("minimum"), number("maximum")].into_iter().flatten();
            let all: Vec<f64> = ends.chain(NUMBERS).chain(NUMBERS.map(|it| -it)).collect();
            json!(choices.of(&all))
        }
        Some("boolean") => (choices.below(2) == 1).into(),
        Some("array") => {
            let size = |key: &str| usize::try_from(schema.get(key)?.as_u64()?).ok();
            let least = size("minItems").unwrap_or(1);
            let count = (least + choices.below(3)).min(size("maxItems").unwrap_or(4));
            let items = schema.get("items").unwrap_or(&Value::Null);
            (0..count.min(6)).map(|_| value(choices, items)).collect()
        }
        Some("object") => table(choices, schema).into(),
        _ => text(choices, schema.get("pattern").and_then(Value::as_str).unwrap_or_default()),
    }
}

/// A table with the keys that it needs, and one more.
fn table(choices: &mut Choices<'_>, schema: &Value) -> Map<String, Value> {
    let list =
        |of: &Value, key: &str| of.get(key).and_then(Value::as_array).cloned().unwrap_or_default();
    let mut keys = list(schema, "required");
    for group in list(schema, "allOf") {
        let forms = list(&group, "oneOf");
        if !forms.is_empty() {
            keys.extend(list(choices.of(&forms), "required"));
        }
    }
    let none = Map::new();
    let properties = schema.get("properties").and_then(Value::as_object).unwrap_or(&none);
    let names: Vec<&String> = properties.keys().collect();
    if !names.is_empty() && choices.below(2) == 1 {
        keys.push((*choices.of(&names)).clone().into());
    }
    let entry = |key: Value| {
        let key = key.as_str().unwrap_or_default().to_owned();
        let value = value(choices, properties.get(&key)?);
        Some((key, value))
    };
    keys.into_iter().filter_map(entry).collect()
}

/// A number with one of the units of a pattern, or a name.
fn text(choices: &mut Choices<'_>, pattern: &str) -> Value {
    let units = pattern.rsplit_once('(').and_then(|(_, rest)| rest.split_once(')'));
    let Some((units, _)) = units.filter(|_| pattern.contains("[0-9]")) else {
        return (*choices.of(&NAMES)).into();
    };
    let units: Vec<&str> = units.split('|').collect();
    let sign = *choices.of(&["", "", "", "-"]);
    format!("{sign}{:e} {}", choices.of(&NUMBERS), choices.of(&units)).into()
}
