//! Files of a crate of the engine use one another without long circles: files that name items of one
//! another, directly or through others, are a circle. Paths behind `use`, `crate::`, `super::` and
//! names of modules count, up to the file that defines the item: a `mod.rs` that passes an item on is
//! not in the way.

use super::crates::{code_of, sources};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Most files of a circle.
const MOST: usize = 4;

/// Names from the root of the engine to a module or an item.
type ItemPath = Vec<String>;

/// A file: names that its `use` lines bring in, with their paths, and paths that its code names.
#[derive(Default)]
struct File {
    /// Name, path, and true where the line passes it on (`pub use`).
    imports: Vec<(String, ItemPath, bool)>,
    named: Vec<ItemPath>,
}

fn names_of(path: &str) -> ItemPath {
    path.split("::").map(str::trim).filter(|name| !name.is_empty()).map(str::to_owned).collect()
}

/// Adds the paths of a tree of `use`, each with the name that it gets.
fn expand(tree: &str, before: &[String], out: &mut Vec<(String, ItemPath)>) {
    let tree = tree.trim();
    if let Some((head, list)) = tree.split_once('{') {
        let list = list.strip_suffix('}').expect("a list in braces");
        let before = [before, &names_of(head)].concat();
        let (mut depth, mut start) = (0, 0);
        for (at, c) in list.char_indices().chain([(list.len(), ',')]) {
            match c {
                '{' => depth += 1,
                '}' => depth -= 1,
                ',' if depth == 0 => {
                    expand(&list[start..at], &before, out);
                    start = at + 1;
                }
                _ => {}
            }
        }
    } else if !tree.is_empty() {
        let (path, alias) = tree.split_once(" as ").unwrap_or((tree, ""));
        let mut path = [before, &names_of(path)].concat();
        path.pop_if(|last| last == "self");
        let name = if alias.is_empty() { path.last().expect("a name").as_str() } else { alias };
        out.push((name.trim().to_owned(), path));
    }
}

impl File {
    fn parse(source: &str) -> Self {
        let mut file = Self::default();
        let code = code_of(source);
        let mut lines = code.lines();
        while let Some(line) = lines.next() {
            let bare = line.trim_start();
            let is_public = bare.starts_with("pub");
            let item = match bare.strip_prefix("pub(").and_then(|rest| rest.split_once(')')) {
                Some((_, rest)) => rest.trim_start(),
                None => bare.strip_prefix("pub ").unwrap_or(bare),
            };
            if let Some(first) = item.strip_prefix("use ") {
                let mut tree = first.to_owned();
                while !tree.contains(';') {
                    tree.push_str(lines.next().expect("the end of a use"));
                }
                let mut found = Vec::new();
                expand(tree.split(';').next().unwrap_or_default(), &[], &mut found);
                file.imports.extend(found.into_iter().map(|(name, path)| (name, path, is_public)));
                continue;
            }
            let words = line.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':'));
            let paths = words.filter(|word| word.contains("::"));
            file.named.extend(paths.map(names_of).filter(|path| path.len() > 1));
        }
        file
    }
}

/// Files of the engine by the paths of their modules, which begin with the name of the crate.
struct Files(BTreeMap<ItemPath, File>);

impl Files {
    /// Files by their paths under the folder of the engine.
    fn of<'a>(sources: impl IntoIterator<Item = (&'a str, &'a str)>) -> Self {
        let sources: Vec<_> = sources.into_iter().collect();
        let roots = sources.iter().filter_map(|(path, _)| path.strip_suffix("/lib.rs"));
        let crates: BTreeSet<&str> = roots.collect();
        let module = |path: &str| {
            let mut names: ItemPath =
                path.trim_end_matches(".rs").split('/').map(str::to_owned).collect();
            names.pop_if(|last| last == "mod" || last == "lib");
            // The facade lies beside the folders of the crates.
            if !path.contains('/') || !crates.contains(names[0].as_str()) {
                names.insert(0, "facade".to_owned());
            }
            names
        };
        let parsed = |(path, source): (&str, &str)| (module(path), File::parse(source));
        Self(sources.into_iter().map(parsed).collect())
    }

    /// The path that a module names by `path`, from its crate; `None` for crates of others and local names.
    fn absolute(&self, module: &[String], path: &[String]) -> Option<ItemPath> {
        let child = || [module, &path[..1]].concat();
        match path.first()?.as_str() {
            "crate" => Some([&module[..1], &path[1..]].concat()),
            "self" => Some([module, &path[1..]].concat()),
            "super" => {
                let up = path.iter().take_while(|name| *name == "super").count();
                let kept = module.len().checked_sub(up)?;
                Some([&module[..kept], &path[up..]].concat())
            }
            _ if self.0.contains_key(&child()) => Some([module, path].concat()),
            other => {
                let member = other.strip_prefix("beamlet_")?.to_owned();
                Some([&[member], &path[1..]].concat())
            }
        }
    }

    /// The module that defines what a path from the root names.
    fn home(&self, path: &[String], passed: &mut BTreeSet<ItemPath>) -> Option<ItemPath> {
        if !passed.insert(path.to_vec()) {
            return None;
        }
        let length = (0..=path.len()).rev().find(|n| self.0.contains_key(&path[..*n]))?;
        let (module, rest) = path.split_at(length);
        if let Some(name) = rest.first() {
            for (_, import, _) in self.0[module].imports.iter().filter(|it| it.0 == *name) {
                if let Some(import) = self.absolute(module, import) {
                    return self.home(&[&import, &rest[1..]].concat(), passed);
                }
            }
        }
        Some(module.to_vec())
    }

    /// Modules whose items a file uses.
    fn uses(&self, module: &[String]) -> BTreeSet<ItemPath> {
        let file = &self.0[module];
        let own = file.imports.iter().filter(|(_, _, is_public)| !is_public);
        let through_module = file.named.iter().filter_map(|path| {
            let import = file.imports.iter().find(|(name, _, _)| *name == path[0])?;
            let target = self.absolute(module, &import.1)?;
            self.0.contains_key(&target).then(|| [&target, &path[1..]].concat())
        });
        own.map(|(_, path, _)| path)
            .chain(&file.named)
            .filter_map(|path| self.absolute(module, path))
            .chain(through_module)
            .filter_map(|path| self.home(&path, &mut BTreeSet::new()))
            .filter(|used| used != module)
            .collect()
    }

    /// Circles of two files and more inside each crate.
    fn circles(&self) -> BTreeSet<Vec<ItemPath>> {
        let uses: BTreeMap<_, _> = self.0.keys().map(|file| (file, self.uses(file))).collect();
        let reached = |from: &ItemPath| {
            let (mut seen, mut waiting) = (BTreeSet::new(), vec![from.clone()]);
            while let Some(file) = waiting.pop() {
                let inside = uses[&file].iter().filter(|used| used.first() == from.first());
                waiting.extend(inside.filter(|used| seen.insert((*used).clone())).cloned());
            }
            seen
        };
        let reached: BTreeMap<_, _> = self.0.keys().map(|file| (file, reached(file))).collect();
        let circle = |file: &ItemPath| -> Vec<ItemPath> {
            reached[file].iter().filter(|other| reached[*other].contains(file)).cloned().collect()
        };
        self.0.keys().map(circle).filter(|circle| circle.len() > 1).collect()
    }
}

#[test]
fn no_circle_of_files_is_longer_than_four() {
    let root = Path::new("engine");
    let mut paths = Vec::new();
    sources(root, &mut paths);
    let read = |path: &std::path::PathBuf| {
        let name = path.strip_prefix(root).expect("a file of the engine").to_string_lossy();
        (name.replace('\\', "/"), fs::read_to_string(path).expect("a source in UTF-8"))
    };
    let texts: Vec<(String, String)> = paths.iter().map(read).collect();
    let files = Files::of(texts.iter().map(|(path, text)| (path.as_str(), text.as_str())));
    let circles = files.circles();
    let long = circles.iter().filter(|circle| circle.len() > MOST);
    let shown = long.map(|circle| {
        let line = |file: &ItemPath| {
            let uses = files.uses(file).into_iter().filter(|used| circle.contains(used));
            let uses: Vec<String> = uses.map(|used| used.join("::")).collect();
            format!("  {} uses {}", file.join("::"), uses.join(", "))
        };
        let lines: Vec<String> = circle.iter().map(line).collect();
        format!("{} files of {}:\n{}", circle.len(), circle[0][0], lines.join("\n"))
    });
    let shown: Vec<String> = shown.collect();
    assert!(shown.is_empty(), "{}", shown.join("\n"));
    assert!(circles.len() > 5, "only {} circles were found", circles.len());
}

/// Three files in a circle, each by another form of path; a fourth uses them and is not in it, nor is
/// the `mod.rs` that passes their items on.
#[test]
fn circles_are_found_in_every_form_of_path() {
    let files = Files::of([
        ("m/lib.rs", "mod a;\npub(crate) use a::A;\npub use c::{self, C};\n"),
        ("m/a.rs", "use super::b::{\n    B,\n};\npub struct A(B);\n"),
        ("m/b.rs", "use crate as m;\nfn b() -> m::c::C {\n}\n"),
        ("m/c.rs", "fn c(a: crate::A) {}\n"),
        ("m/d.rs", "use super::{A, C};\n// super::d::D\n#[cfg(test)]\nuse super::d;\n"),
        ("n/lib.rs", "use beamlet_m::A as Other;\n"),
    ]);
    let circle = ["a", "b", "c"].map(|name| vec!["m".to_owned(), name.to_owned()]).to_vec();
    assert_eq!(files.circles(), BTreeSet::from([circle]));
    let used = files.uses(&["n".to_owned()]);
    assert_eq!(used, BTreeSet::from([vec!["m".to_owned(), "a".to_owned()]]));
}
