//! Tables of docs/scene.md are those of the table of keys. `BEAMLET_WRITE_DOCS=1` writes them.

use beamlet::cli_support::json_schema;
use beamlet::internals::scene::{tables, title};
use beamlet::scene::Scene;

const DOCS: &str = "docs/scene.md";

/// The page with the table of keys of each section as the engine has it.
fn made(page: &str) -> String {
    let mut left = tables();
    left.push(("title", title()));
    let mut out = Vec::new();
    for section in page.split("\n## ") {
        let heading = section.lines().next().unwrap();
        let names = |path: &str| [path.to_owned(), format!("[{path}]"), format!("[[{path}]]")];
        let is_of =
            |path: &str| heading.split(' ').any(|word| names(path).iter().any(|it| it == word));
        match left.iter().position(|(path, _)| is_of(path)) {
            Some(at) => out.push(with_table(section, &left.remove(at).1)),
            None => out.push(section.to_owned()),
        }
    }
    let missing: Vec<_> = left.iter().map(|(path, _)| path).collect();
    assert!(missing.is_empty(), "{DOCS} has no section for {missing:?}");
    out.join("\n## ")
}

/// A section with this table in place of its table of keys.
fn with_table(section: &str, table: &str) -> String {
    let start = section.find("| key |").unwrap_or_else(|| panic!("no table of keys in {section}"));
    let rest = &section[start..];
    let end = rest.find("\n\n").map_or(rest.len(), |at| at + 1);
    format!(
        "{}{}{}",
        &section[..start],
        table.trim_end_matches('\n').to_owned() + "\n",
        &rest[end..]
    )
}

#[test]
fn tables_of_the_page_are_those_of_the_keys() {
    let page = std::fs::read_to_string(DOCS).unwrap();
    let made = made(&page);
    if std::env::var_os("BEAMLET_WRITE_DOCS").is_some() {
        std::fs::write(DOCS, &made).unwrap();
        return;
    }
    let differing = page.lines().zip(made.lines()).find(|(page, made)| page != made);
    assert!(
        page == made,
        "{DOCS} differs from the table of keys; write it with BEAMLET_WRITE_DOCS=1\n{differing:#?}"
    );
}

#[test]
fn a_row_that_differs_or_lacks_is_found() {
    let page = std::fs::read_to_string(DOCS).unwrap();
    for (from, to) in [("| `pitch` |", "| `pitsch` |"), ("`\"150 um\"` |\n", "`\"151 um\"` |\n")] {
        assert!(page.contains(from), "{from}");
        let changed = page.replacen(from, to, 1);
        assert_ne!(made(&changed), changed);
    }
}

#[test]
fn example_of_a_whole_scene_loads() {
    let page = std::fs::read_to_string(DOCS).unwrap();
    let mut blocks = page.split("```toml\n").skip(1);
    let text = blocks.next().unwrap().split("```").next().unwrap();
    Scene::from_toml(text, ".").unwrap();
}

/// A scene with every table that has a default.
const FULL: &str = r#"
source = { distance = "1.21 m", spot = "30 um", spectrum = { anode = "tungsten", kvp = "60 kV" } }
detector = { distance = "1.8 m", pixels = [8, 8], pitch = "150 um", photons = 100 }
sample_mask = { distance = "1.2 m", transmission = 0, aperture = "20 um" }
sampling = {}
scan = {}
surroundings = {}
[[object]]
name = "cone"
material = "carbon"
shape = { cone = { radius = "10 um", height = "10 um" } }
[[object]]
name = "balls"
material = "carbon"
shape = { sphere = { radius = "10 um" } }
instances = { packing = "spheres", region = { sphere = { radius = "1 mm" } }, count = 2 }
"#;

#[test]
fn defaults_of_the_table_are_those_of_the_reader() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("scene.toml");
    std::fs::write(&path, FULL).unwrap();
    let without = Scene::load(&path).unwrap();
    let schema = json_schema();
    let mut compared = 0;
    for (keys, pointer) in [
        ("source.spectrum", "/source/properties/spectrum/anyOf/1"),
        ("detector", "/detector"),
        ("sample_mask", "/sample_mask"),
        ("sampling", "/sampling"),
        ("scan", "/scan"),
        ("surroundings", "/surroundings"),
        ("object.cone", "/object/items"),
        ("object.cone.shape.cone", "/object/items/properties/shape/properties/cone"),
        ("object.balls.instances", "/object/items/properties/instances/anyOf/1"),
    ] {
        let table = schema.pointer(&format!("/properties{pointer}/properties")).unwrap();
        for (key, about) in table.as_object().unwrap() {
            let Some(default) = about.get("default") else { continue };
            let set = format!("{keys}.{key}={default}");
            assert_eq!(
                Scene::load_with(&path, std::slice::from_ref(&set)).unwrap(),
                without,
                "{set}"
            );
            compared += 1;
        }
    }
    assert!(compared > 25, "only {compared} defaults");
}
