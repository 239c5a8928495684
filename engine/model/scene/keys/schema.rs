//! The JSON Schema of scene files, draft 4, as editors take it for TOML too.

use serde_json::{Map, Value, json};

use super::row::{Form, Group, Kind, Need, Range, Row, Spec};
use super::top::TOP;
use beamlet_core::units::Dimension;

/// The JSON Schema of a scene file. It knows kinds, words, ranges of numbers, signs of quantities and
/// which keys exclude one another; [`crate::scene::Scene::load`] checks more.
#[must_use]
pub fn json_schema() -> Value {
    let mut schema = table(&TOP);
    let about =
        [("$schema", "http://json-schema.org/draft-04/schema#"), ("title", "beamlet scene")];
    for (key, text) in about {
        schema[key] = text.into();
    }
    schema
}

fn table(spec: &Spec) -> Value {
    let mut properties = Map::new();
    for row in spec.rows {
        properties.insert(row.name.to_owned(), property(row));
    }
    let in_form = |row: &&Row| spec.forms(row.name).is_some();
    let needed = |row: &&Row| matches!(row.need, Need::Required);
    let required: Vec<&str> =
        spec.rows.iter().filter(|row| needed(row) && !in_form(row)).map(|row| row.name).collect();
    let mut schema = json!({
        "type": "object", "properties": properties, "additionalProperties": false,
    });
    if !required.is_empty() {
        schema["required"] = json!(required);
    }
    let mut choices = Vec::new();
    let mut dependencies = Map::new();
    for group in spec.groups {
        match group {
            Group::Forms(forms, _) => {
                // Without a required key a table may have no form.
                let is_needed = forms.iter().any(|own| !needed_keys(spec, own).is_empty());
                let forms: Vec<Value> = forms.iter().map(|own| form(spec, own)).collect();
                choices.push(json!({ if is_needed { "oneOf" } else { "anyOf" }: forms }));
            }
            // A word has a default, which the key need not be there for.
            Group::With(_, head, _)
                if spec.row(head).is_some_and(|it| matches!(it.kind, Kind::Word(_))) => {}
            Group::With(keys, head, _) => {
                let heads = spec.heads(head);
                let needs = match heads.as_slice() {
                    [_] => json!(heads),
                    _ => {
                        let one = heads.iter().map(|key| json!({ "required": [key] }));
                        json!({ "anyOf": one.collect::<Vec<_>>() })
                    }
                };
                dependencies.extend(keys.iter().map(|key| ((*key).to_owned(), needs.clone())));
            }
        }
    }
    if !choices.is_empty() {
        schema["allOf"] = json!(choices);
    }
    if !dependencies.is_empty() {
        schema["dependencies"] = Value::Object(dependencies);
    }
    schema
}

/// Keys of a form that a table of this form must have.
fn needed_keys(spec: &Spec, own: Form) -> Vec<&'static str> {
    let needed = |key: &&&str| spec.row(key).is_some_and(|row| matches!(row.need, Need::Required));
    own.iter().filter(needed).copied().collect()
}

/// Tables of one form: its required keys are there, and no key of another.
fn form(spec: &Spec, own: Form) -> Value {
    let required = needed_keys(spec, own);
    let others: Vec<Value> =
        spec.rivals_of(own).iter().map(|key| json!({ "required": [key] })).collect();
    let mut form = json!({ "not": { "anyOf": others } });
    if !required.is_empty() {
        form["required"] = json!(required);
    }
    form
}

fn property(row: &Row) -> Value {
    let mut schema = kind(&row.kind);
    schema["description"] = row.doc.into();
    if let Need::Default(text) = row.need
        && let Ok(toml::Value::Table(mut table)) =
            format!("it = {text}").parse().map(toml::Value::Table)
        && let Some(default) = table.remove("it")
    {
        schema["default"] = json!(default);
    }
    schema
}

fn kind(kind: &Kind) -> Value {
    match kind {
        Kind::Line => json!({ "type": "string", "minLength": 1 }),
        Kind::Name(_) | Kind::File(_) => json!({ "type": "string", "pattern": "\\S" }),
        Kind::Hash => json!({ "type": "string", "pattern": "^[0-9a-fA-F]{64}$" }),
        Kind::Flag => json!({ "type": "boolean" }),
        Kind::Word(words) => json!({ "enum": words }),
        Kind::Quantity(dimension, range) => quantity(&[*dimension], *range),
        Kind::Rectangles(most) => {
            let lengths = several(&quantity(&[Dimension::Length], super::row::ANY), 4, 4);
            several(&lengths, 1, *most)
        }
        Kind::Step => quantity(&[Dimension::Length, Dimension::Angle], super::row::ANY),
        Kind::Unit => {
            let units =
                Dimension::Length.units().map(|unit| escaped(&unit)).collect::<Vec<_>>().join("|");
            json!({ "type": "string", "pattern": format!("^\\s*(([0-9.][0-9.eE+-]*\\s*)?({units})|inch|inches)\\s*$") })
        }
        Kind::Pair(range) => {
            let one = quantity(&[Dimension::Length], *range);
            json!({ "anyOf": [one, several(&one, 2, 2)] })
        }
        Kind::Lengths(_, range) => several(&quantity(&[Dimension::Length], *range), 3, 3),
        Kind::Corners(most) => pairs(3, *most),
        Kind::Ends(most) => pairs(1, *most),
        Kind::Bits(most) => {
            let row = json!({ "type": "string", "pattern": "^[01]+$", "maxLength": most });
            several(&row, 1, *most)
        }
        Kind::Series(dimension, most) => {
            several(&quantity(&[*dimension], super::row::ANY), 1, *most)
        }
        Kind::Lists(dimension, most) => json!({
            "type": "array",
            "items": several(
                &dimension.map_or_else(
                    || number(super::row::ANY),
                    |dimension| quantity(&[dimension], super::row::ANY),
                ),
                1,
                *most,
            ),
        }),
        Kind::Number(_, range) => number(*range),
        Kind::Direction => several(&json!({ "type": "number" }), 3, 3),
        Kind::Count(low, high) => whole(*low, *high),
        Kind::Counts(_, low, high) => several(&whole(*low, *high), 2, 2),
        Kind::Inner(spec) => table(spec),
        Kind::Tables(spec) => json!({ "type": "array", "items": table(spec) }),
        Kind::Named(values) => {
            json!({ "type": "object", "additionalProperties": self::kind(values) })
        }
        Kind::Either(_, short, table) => json!({ "anyOf": [self::kind(short), self::kind(table)] }),
    }
}

/// Pairs of lengths.
fn pairs(least: u32, most: u32) -> Value {
    several(&several(&quantity(&[Dimension::Length], super::row::ANY), 2, 2), least, most)
}

fn several(item: &Value, least: u32, most: u32) -> Value {
    json!({ "type": "array", "items": item, "minItems": least, "maxItems": most })
}

/// Editors read whole numbers as f64: limits beyond its whole numbers are left out.
fn whole(low: u64, high: u64) -> Value {
    let mut schema = json!({ "type": "integer", "minimum": low });
    if high < 1 << 53 {
        schema["maximum"] = high.into();
    }
    schema
}

fn number(range: Range) -> Value {
    let mut schema = json!({ "type": "number" });
    for (bound, limit, excludes) in
        [(range.low, "minimum", "exclusiveMinimum"), (range.high, "maximum", "exclusiveMaximum")]
    {
        let Some((bound, itself)) = bound else { continue };
        schema[limit] = bound.into();
        if !itself {
            schema[excludes] = true.into();
        }
    }
    schema
}

/// A unit as part of a pattern.
fn escaped(unit: &str) -> String {
    unit.replace('^', "\\^")
}

/// Quantities as text: digits, then a unit of one of the dimensions. Of a range from 0 the sign is
/// left out.
fn quantity(dimensions: &[Dimension], range: Range) -> Value {
    let sign = if range.low.is_some_and(|(low, _)| low >= 0.0) { "[+]?" } else { "[+-]?" };
    let digits = match range.low {
        Some((low, itself)) if low > 0.0 || !itself => "(?=[0-9.]*[1-9])[0-9]*\\.?[0-9]*",
        _ => "(?=[0-9.]*[0-9])[0-9]*\\.?[0-9]*",
    };
    let units =
        dimensions.iter().flat_map(|dimension| dimension.units()).map(|unit| escaped(&unit));
    let units = units.collect::<Vec<_>>().join("|");
    let pattern = format!("^\\s*{sign}{digits}([eE][+-]?[0-9]+)?\\s*({units})\\s*$");
    json!({ "type": "string", "pattern": pattern })
}
