//! docs/scene.md documents every key that the reader takes, and no other.

use beamlet::scene::{Scene, known_keys};

const DOCS: &str = include_str!("../../docs/scene.md");

/// The section about a table, which has its name in the heading.
fn section(table: &str) -> &'static str {
    let names = [format!("[{table}]"), format!("[[{table}]]")];
    DOCS.split("\n## ")
        .find(|section| {
            let heading = section.lines().next().unwrap_or_default();
            heading.split(' ').any(|word| names.iter().any(|name| name == word))
        })
        .unwrap_or_else(|| panic!("docs/scene.md has no section for [{table}]"))
}

/// Keys of the rows of a section, with the cells after the key.
fn rows(section: &'static str) -> Vec<(&'static str, Vec<&'static str>)> {
    let row = |line: &'static str| {
        let (key, rest) = line.strip_prefix("| `")?.split_once("` |")?;
        let rest = rest.strip_suffix('|').unwrap_or(rest);
        Some((key, rest.split('|').map(str::trim).collect()))
    };
    section.lines().filter_map(row).collect()
}

#[test]
fn every_key_has_unit_default_range_and_example() {
    for (table, keys) in known_keys() {
        if table.is_empty() {
            keys.iter().for_each(|key| {
                // It is no table, but has a row as the keys of tables have.
                if *key == "title" {
                    let documented = DOCS.split("\n## title\n").nth(1).map(rows);
                    let cells = documented.and_then(|rows| Some(rows.first()?.1.len()));
                    assert_eq!(cells, Some(4), "title: unit, default, range, example");
                    return;
                }
                section(if *key == "materials" { "materials.NAME" } else { key });
            });
            continue;
        }
        let documented = rows(section(table));
        for key in *keys {
            let row = documented.iter().find(|row| row.0 == *key);
            let (_, cells) = row.unwrap_or_else(|| panic!("{table}.{key} is not documented"));
            assert_eq!(cells.len(), 4, "{table}.{key}: unit, default, range, example");
            assert!(!cells[0].is_empty() && !cells[3].is_empty(), "{table}.{key}");
        }
        for (key, _) in documented {
            assert!(keys.contains(&key), "{table}.{key} is documented but not read");
        }
    }
}

#[test]
fn example_of_a_whole_scene_loads() {
    let mut blocks = DOCS.split("```toml\n").skip(1);
    let text = blocks.next().unwrap().split("```").next().unwrap();
    Scene::from_toml(text, ".").unwrap();
}
