//! Overrides: `key.path=value`, as the command line's `--set` takes them.

use super::keys::record::values_of;
use super::keys::row::{Kind, Spec};
use super::keys::top::TOP;
use super::parse::toml_value;
use super::path::{self, Step};
use super::table::with_suggestion;
use super::tree::{Document, Origin, TreeEntry, TreeNode, TreeValue};
use beamlet_core::{Error, Result};

/// Most steps of a path. A scene has five; trees without a limit would overflow the stack.
const DEPTH: usize = 32;

/// Applies an override to the document.
pub(super) fn apply(document: &mut Document, set: &str) -> Result<()> {
    let index = document.sets.len();
    document.sets.push(set.to_owned());
    let origin = Origin::Set(index);
    let refuse = |document: &Document, key: &str, found: String, allowed: String| Error::Scene {
        place: Box::new(document.place(&origin)),
        key: key.to_owned(),
        found,
        allowed,
    };
    let form = "key.path=value, such as source.energy=\"40 keV\" or object[0].material=gold";
    let Some((key, value)) = set.split_once('=') else {
        return Err(refuse(document, set, "no `=`".to_owned(), form.to_owned()));
    };
    let key = key.trim();
    let Some(steps) = path::parse(key).filter(|steps| steps.len() <= DEPTH) else {
        return Err(refuse(document, key, "no path of keys".to_owned(), form.to_owned()));
    };
    let value = match toml_value(value, &origin) {
        Ok(value) => value,
        Err(problem) => {
            return Err(refuse(document, key, problem, "a TOML value".to_owned()));
        }
    };
    match target(&mut document.root, &steps, &origin) {
        Ok(node) => {
            *node = TreeNode { value, origin };
            Ok(())
        }
        Err((found, allowed)) => Err(refuse(document, key, found, allowed)),
    }
}

/// Found and allowed, where a step leads nowhere.
type Astray = (String, String);

/// The node that the steps lead to. Tables and keys that are not there are added, for the
/// reader to judge.
fn target<'a>(
    mut node: &'a mut TreeNode,
    steps: &[Step],
    origin: &Origin,
) -> std::result::Result<&'a mut TreeNode, Astray> {
    let mut here = Keys::Of(&TOP);
    for step in steps {
        let keys = here;
        if let Step::Key(key) = step
            && !matches!(node.value, TreeValue::List(_))
        {
            here = keys.below(key);
        }
        node = match (&mut node.value, step) {
            (TreeValue::Table(entries), Step::Key(key)) => {
                if let Keys::Of(spec) = keys {
                    drop_rivals(entries, key, spec);
                }
                let at = match entries.iter().position(|entry| entry.key == *key) {
                    Some(at) => at,
                    None => {
                        let value = TreeValue::Table(Vec::new());
                        let node = TreeNode { value, origin: origin.clone() };
                        entries.push(TreeEntry { key: key.clone(), origin: origin.clone(), node });
                        entries.len() - 1
                    }
                };
                &mut entries[at].node
            }
            (TreeValue::List(items), Step::Index(index)) => {
                let count = items.len();
                items.get_mut(*index).ok_or_else(|| {
                    let allowed = match count {
                        0 => "no index, for the list is empty".to_owned(),
                        1 => "index 0".to_owned(),
                        _ => format!("an index of 0 to {}", count - 1),
                    };
                    (format!("index {index} of a list of {count}"), allowed)
                })?
            }
            (TreeValue::List(items), Step::Key(name)) => {
                let names: Vec<_> = items.iter().map(|item| name_of(item).to_owned()).collect();
                match names.iter().position(|other| other == name) {
                    Some(at) => &mut items[at],
                    None => {
                        let allowed = format!("an index as in [0], or one of {names:?}");
                        let names = names.iter().map(String::as_str);
                        return Err((format!("{name:?}"), with_suggestion(allowed, name, names)));
                    }
                }
            }
            (_, Step::Index(index)) => {
                return Err((format!("index {index} of no list"), "an index of a list".to_owned()));
            }
            (_, Step::Key(key)) => {
                let found = format!("the key `{key}` below a single value");
                return Err((found, "a key of a table".to_owned()));
            }
        };
    }
    Ok(node)
}

/// The keys of a table that steps lead to.
#[derive(Debug, Clone, Copy)]
enum Keys {
    Of(&'static Spec),
    /// Names that the scene chooses, of values of a kind.
    Names(&'static Kind),
    Unknown,
}

impl Keys {
    /// The keys of the table at a key.
    fn below(self, key: &str) -> Self {
        let kind = match self {
            Self::Of(spec) => spec.row(key).map(|row| &row.kind),
            Self::Names(kind) => Some(kind),
            Self::Unknown => None,
        };
        let table = |kind: &'static Kind| kind.table().map(Self::Of);
        kind.and_then(|kind| values_of(kind).map(Self::Names).or_else(|| table(kind)))
            .unwrap_or(Self::Unknown)
    }
}

/// Drops the file's values of keys that a key excludes. Values of an earlier override stay, and the
/// reader reports the conflict.
fn drop_rivals(entries: &mut Vec<TreeEntry>, key: &str, spec: &Spec) {
    // They go with a mesh and choose none: beside a shape they are a mistake that the reader names.
    if matches!(key, "unit" | "group") {
        return;
    }
    let mut rivals = spec.rivals(key);
    if key == "mesh" {
        // The recorded hash belongs to the mesh that the file names.
        rivals.push("sha256");
    }
    entries.retain(|entry| {
        !(matches!(entry.origin, Origin::Text(_)) && rivals.contains(&entry.key.as_str()))
    });
}

fn name_of(item: &TreeNode) -> &str {
    let TreeValue::Table(entries) = &item.value else { return "" };
    let name = entries.iter().find(|entry| entry.key == "name");
    match name.map(|entry| &entry.node.value) {
        Some(TreeValue::Text(name)) => name,
        _ => "",
    }
}
