//! Overrides: `key.path=value`, as the command line's `--set` takes them.

use super::parse::toml_value;
use super::path::{self, Step};
use super::table::with_suggestion;
use super::tree::{Document, Origin, TreeEntry, TreeNode, TreeValue};
use crate::{Error, Result};

/// Keys that exclude each other: an override of one side drops what the file says on the other.
const RIVALS: &[(&[&str], &[&str])] = &[
    (&["energy"], &["spectrum"]),
    (&["file"], &["anode", "kvp", "anode_angle", "inherent_filters"]),
    (&["aperture"], &["projected_aperture"]),
    (&["material", "thickness"], &["transmission"]),
    (&["mesh", "unit", "sha256"], &["shape"]),
    (&["formula"], &["mixture"]),
    (&["formula", "mixture", "density"], &["mu", "delta"]),
    (&["formula", "mixture", "density"], &["table"]),
    (&["mu", "delta"], &["table"]),
    (&["count"], &["step"]),
    (&["from"], &["start"]),
    (&["to"], &["stop"]),
    (&["sigma"], &["fwhm"]),
    (&["sigma"], &["kernel", "pixel"]),
    (&["fwhm"], &["kernel", "pixel"]),
    (&["image"], &["kernel", "pixel", "fraction"]),
];

/// The same within the focal spot, whose image has a pixel.
const SPOT_RIVALS: [&[&str]; 4] =
    [&["image", "pixel", "background"], &["profile"], &["gaussians"], &["fwhm", "points"]];

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
    for (depth, step) in steps.iter().enumerate() {
        // The keys of [materials] and of a mixture are names that the scene chose.
        let names = matches!(&steps[..depth], [Step::Key(table)] if table == "materials")
            || matches!(&steps[..depth], [Step::Key(table), _, Step::Key(mixture)]
                if table == "materials" && mixture == "mixture");
        node = match (&mut node.value, step) {
            (TreeValue::Table(entries), Step::Key(key)) => {
                if !names {
                    drop_rivals(entries, key, &steps[..depth]);
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
                    (format!("index {index} of a list of {count}"), "an index from 0".to_owned())
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

fn drop_rivals(entries: &mut Vec<TreeEntry>, key: &str, table: &[Step]) {
    if matches!(table, [.., Step::Key(spot)] if spot == "spot") {
        let Some(own) = SPOT_RIVALS.iter().find(|keys| keys.contains(&key)) else { return };
        entries.retain(|entry| {
            !matches!(entry.origin, Origin::Text(_)) || own.contains(&entry.key.as_str())
        });
        return;
    }
    for (one, other) in RIVALS {
        let rivals = match (one.contains(&key), other.contains(&key)) {
            (true, _) => other,
            (_, true) => one,
            _ => continue,
        };
        // An object has a material beside its shape or mesh; only a mask has rivals to it.
        // Rivals that an earlier override set stay, and the reader reports the conflict.
        entries.retain(|entry| {
            let from_file = matches!(entry.origin, Origin::Text(_));
            !(from_file && rivals.contains(&entry.key.as_str()))
        });
    }
    // The recorded hash is that of the mesh which the file names.
    if key == "mesh" {
        entries.retain(|entry| entry.key != "sha256" || matches!(entry.origin, Origin::Set(_)));
    }
}

fn name_of(item: &TreeNode) -> &str {
    let TreeValue::Table(entries) = &item.value else { return "" };
    let name = entries.iter().find(|entry| entry.key == "name");
    match name.map(|entry| &entry.node.value) {
        Some(TreeValue::Text(name)) => name,
        _ => "",
    }
}
