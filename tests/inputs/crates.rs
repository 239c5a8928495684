//! The crates of the engine: the arrows of docs/developers/architecture.md are those of Cargo.

use std::fs;

/// Members named in a line of dependencies.
fn members_in(text: &str) -> Vec<&str> {
    text.lines()
        .filter_map(|line| line.strip_prefix("beamlet-")?.split_once(".workspace = true"))
        .map(|(name, _)| name)
        .collect()
}

#[test]
fn arrows_of_the_document_are_those_of_cargo() {
    let text = fs::read_to_string("docs/developers/architecture.md").unwrap();
    let after = text.split_once("## Crates").unwrap().1;
    let rows = after.lines().filter_map(|line| line.strip_prefix("| `beamlet-"));
    let mut above: Vec<String> = Vec::new();
    for row in rows {
        let cells: Vec<&str> = row.split(" | ").collect();
        let name = cells[0].trim_end_matches('`');
        let drawn: Vec<&str> = match cells[1].trim() {
            "–" => Vec::new(),
            list => list.split(", ").collect(),
        };
        let manifest = fs::read_to_string(format!("engine/{name}/Cargo.toml")).unwrap();
        let (_, after) = manifest.split_once("[dependencies]").unwrap();
        let used = members_in(after.split("\n[").next().unwrap());
        assert_eq!(drawn, used, "docs/developers/architecture.md: row of beamlet-{name}");
        // The table goes from the lowest crate up.
        let upward: Vec<_> =
            used.iter().filter(|it| !above.iter().any(|below| below == *it)).collect();
        assert!(upward.is_empty(), "beamlet-{name} stands below {upward:?}");
        above.push(name.to_owned());
    }
    let folders = fs::read_dir("engine").unwrap().map(|entry| entry.unwrap().path());
    let members = folders.filter(|path| path.join("lib.rs").exists()).count();
    assert_eq!(above.len(), members, "docs/developers/architecture.md lacks a crate: {above:?}");
}
