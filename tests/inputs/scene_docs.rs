//! Tables of docs/scene.md are those of the table of keys. `BEAMLET_WRITE_DOCS=1` writes them.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

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
