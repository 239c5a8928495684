//! The tables of docs/scene.md.

use super::row::{Kind, Need, Row, Spec};
use super::top::TOP;
use beamlet_core::units::Dimension;

/// The tables of a scene file by their headings in docs/scene.md, each as Markdown.
#[must_use]
pub fn tables() -> Vec<(&'static str, String)> {
    let mut specs = Vec::new();
    gather(&TOP, &mut specs);
    specs.iter().map(|spec| (spec.path, markdown(spec))).collect()
}

/// Adds the tables that a table leads to, each once.
fn gather(spec: &'static Spec, specs: &mut Vec<&'static Spec>) {
    for row in spec.rows {
        let below = match &row.kind {
            Kind::Named(values) => values.table(),
            kind => kind.table(),
        };
        if let Some(below) = below.filter(|below| specs.iter().all(|it| it.path != below.path)) {
            specs.push(below);
            gather(below, specs);
        }
    }
}

/// The row of the title, which is the only key of the top level that is no table.
#[must_use]
pub fn title() -> String {
    rows(TOP.rows.iter().filter(|row| matches!(row.kind, Kind::Line)), &TOP)
}

fn markdown(spec: &Spec) -> String {
    rows(spec.rows.iter(), spec)
}

fn rows(rows: impl Iterator<Item = &'static Row>, spec: &Spec) -> String {
    let mut out = String::from(
        "| key | meaning | unit | default | range | example |\n|---|---|---|---|---|---|\n",
    );
    for row in rows {
        let (unit, range) = (unit(&row.kind), range(&row.kind));
        let default = default(row, spec);
        let example = if row.example.contains(' ') && !row.example.contains(['"', '[', '{']) {
            row.example.to_owned()
        } else {
            format!("`{}`", row.example)
        };
        let cells = [format!("`{}`", row.name), row.doc.to_owned(), unit, default, range, example];
        out += &format!("| {} |\n", cells.join(" | "));
    }
    out
}

/// A noun without its article.
fn bare(noun: &str) -> String {
    noun.strip_prefix("a ").or_else(|| noun.strip_prefix("an ")).unwrap_or(noun).to_owned()
}

fn noun(dimension: Dimension) -> String {
    bare(dimension.allowed().split(" with").next().unwrap_or_default())
}

fn unit(kind: &Kind) -> String {
    match kind {
        Kind::Line => "line of text".into(),
        Kind::Quantity(dimension, _) => noun(*dimension),
        Kind::Pair(_) => "length, or a list of two: x, z".into(),
        Kind::Lengths(..) => "three lengths".into(),
        Kind::Corners(_) | Kind::Ends(_) => "list of pairs of lengths".into(),
        Kind::Bits(_) => "list of texts".into(),
        Kind::Rectangles(_) => "list of lists of four lengths".into(),
        Kind::Step => "length or angle".into(),
        Kind::Series(dimension, _) => format!("list of {}s", noun(*dimension)),
        Kind::Lists(dimension, _) => {
            let noun = dimension.map_or_else(|| "number".to_owned(), noun);
            format!("list of lists of {noun}s")
        }
        Kind::Unit => "unit of length, or a length".into(),
        Kind::Number(noun, _) => bare(noun),
        Kind::Direction => "direction".into(),
        Kind::Count(..) => "count".into(),
        Kind::Counts(noun, ..) => (*noun).into(),
        Kind::Flag => "true or false".into(),
        Kind::Word(_) => "word".into(),
        Kind::Name(_) => "name".into(),
        Kind::File(noun) => (*noun).into(),
        Kind::Hash => "64 hexadecimal digits".into(),
        Kind::Inner(_) | Kind::Named(Kind::Inner(_)) => "table".into(),
        Kind::Named(values) => format!("table of {}s by name", unit(values)),
        Kind::Tables(_) => "list of tables".into(),
        Kind::Either(_, short, Kind::Inner(_)) => format!("{}, or a table", unit(short)),
        Kind::Either(_, one, other) => format!("{}, or {}", unit(one), unit(other)),
    }
}

fn range(kind: &Kind) -> String {
    match kind {
        Kind::Line => "1 to 200 characters".into(),
        Kind::Corners(most) => format!("3 to {most} corners"),
        Kind::Ends(most) | Kind::Rectangles(most) => format!("1 to {most} of them"),
        Kind::Bits(most) => format!("up to {most} rows and columns"),
        Kind::Series(_, most) => format!("1 to {most} of them"),
        Kind::Lists(_, most) => format!("up to {most} of them each"),
        Kind::Unit => "> 0".into(),
        Kind::Direction => "length > 0".into(),
        Kind::Word(words) => {
            words.iter().map(|it| format!("`\"{it}\"`")).collect::<Vec<_>>().join(", ")
        }
        Kind::Either(_, short, _) => range(short),
        Kind::Named(values) => range(values),
        _ => kind.bounds().unwrap_or_default(),
    }
}

/// Value that holds where a key is left out, and the keys that it needs.
fn default(row: &Row, spec: &Spec) -> String {
    let quoted = |key: &&str| format!("`{key}`");
    let forms = spec.forms(row.name).map(|(forms, _)| forms).unwrap_or_default();
    let own: Vec<_> = forms.iter().filter(|form| form.contains(&row.name)).collect();
    let heads: Vec<&str> =
        own.iter().map(|form| form[0]).filter(|head| *head != row.name).collect();
    let with = match spec.with(row.name) {
        // A word counts with its default, too.
        Some((head, _)) if spec.row(head).is_some_and(|it| matches!(it.kind, Kind::Word(_))) => {
            Vec::new()
        }
        Some((head, _)) => spec.heads(head),
        None => heads,
    };
    let and = if spec.with(row.name).is_some() { " or " } else { " and " };
    let with = with.iter().map(quoted).collect::<Vec<_>>().join(and);
    match (&row.need, with.as_str()) {
        (Need::Required, "") if forms.is_empty() => "required".into(),
        (Need::Required, "") => {
            let mut others: Vec<_> = forms.iter().map(|form| form[0]).collect();
            others.sort_by_key(|head| spec.rows.iter().position(|row| row.name == *head));
            match others.iter().filter(|head| **head != row.name).collect::<Vec<_>>().as_slice() {
                [other] => format!("required without {}", quoted(other)),
                many if many.len() > 7 => "one of these".into(),
                _ => format!("one of {}", others.iter().map(quoted).collect::<Vec<_>>().join(", ")),
            }
        }
        (Need::Required, with) => format!("required with {with}"),
        (Need::Default(toml), "") => format!("`{toml}`"),
        (Need::Default(toml), with) => format!("`{toml}`; with {with}"),
        (Need::Without(words), with) if with.is_empty() || words.contains(with) => (*words).into(),
        (Need::Without(words), with) => format!("{words}; with {with}"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::row::Group;
    use super::*;

    fn every(spec: &'static Spec) -> Vec<&'static Spec> {
        let mut specs = vec![spec];
        gather(spec, &mut specs);
        specs
    }

    #[test]
    fn groups_and_other_names_are_of_keys_of_their_table() {
        for spec in every(&TOP) {
            let known = |key: &str| assert!(spec.row(key).is_some(), "{}.{key}", spec.path);
            for group in spec.groups {
                match group {
                    Group::Forms(forms, missing) => {
                        assert!(*missing < forms.len());
                        forms.iter().flat_map(|form| form.iter()).for_each(|key| known(key));
                    }
                    Group::With(keys, head, _) => {
                        keys.iter().chain([head]).for_each(|key| known(key))
                    }
                }
            }
            spec.other_names.iter().for_each(|(other, meant)| {
                known(meant);
                assert!(spec.row(other).is_none(), "{}.{other}", spec.path);
            });
        }
    }
}
