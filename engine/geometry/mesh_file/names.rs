//! Names of the triangles of a mesh file: objects, groups, materials.

use std::collections::HashMap;

use crate::surface::Defect;
use beamlet_core::{numbers, printed, suggestion};

/// Names that a message lists.
const MOST_NAMES_TOLD: usize = 12;

/// Names that a triangle has.
#[derive(Debug, Clone, Default, PartialEq, Eq, Hash)]
pub(super) struct Label {
    /// The object, and of 3MF those that it is a component of.
    pub(super) objects: Vec<String>,
    pub(super) groups: Vec<String>,
    pub(super) material: Option<String>,
}

impl Label {
    fn names(&self) -> impl Iterator<Item = &str> {
        let parts = self.objects.iter().chain(&self.groups).chain(&self.material);
        parts.map(String::as_str)
    }
}

/// The labels of a file, and which triangle has which.
#[derive(Debug, Default)]
pub(super) struct Names {
    labels: Vec<Label>,
    known: HashMap<Label, u32>,
    /// Label of every triangle of the file, with triangles that are not finite.
    of_triangle: Vec<u32>,
}

impl Names {
    /// The number of a label.
    pub(super) fn number(&mut self, label: &Label) -> u32 {
        if let Some(number) = self.known.get(label) {
            return *number;
        }
        let number = numbers::count(self.labels.len());
        self.labels.push(label.clone());
        self.known.insert(label.clone(), number);
        number
    }

    /// Gives the next triangle of the file the label of this number.
    pub(super) fn push(&mut self, label: u32) {
        self.of_triangle.push(label);
    }

    /// The label of each triangle, by number.
    pub(super) fn of_triangles(&self) -> &[u32] {
        &self.of_triangle
    }

    /// Which labels go by a name.
    ///
    /// # Errors
    /// None does; an object and a group or material with other triangles have the name.
    pub(super) fn taken(&self, group: &str) -> Result<Vec<bool>, Defect> {
        let is_name = |name: &String| name == group;
        let meant = |of: &dyn Fn(&Label) -> bool| self.labels.iter().map(of).collect::<Vec<bool>>();
        let meanings = [
            ("an object", meant(&|label| label.objects.iter().any(is_name))),
            ("a group", meant(&|label| label.groups.iter().any(is_name))),
            ("a material", meant(&|label| label.material.iter().any(is_name))),
        ];
        let mut meanings = meanings.into_iter().filter(|(_, taken)| taken.contains(&true));
        if let Some((meaning, taken)) = meanings.next() {
            let Some((other, _)) = meanings.find(|(_, others)| *others != taken) else {
                return Ok(taken);
            };
            let name = printed::line(group);
            let problem = format!("\"{name}\" is {meaning} and {other} with other triangles");
            return Err(Defect::new(problem, "rename one of them in the file"));
        }
        let mut all: Vec<&str> = Vec::new();
        for name in self.labels.iter().flat_map(Label::names) {
            if !all.contains(&name) {
                all.push(name);
            }
        }
        let place =
            match (all.is_empty(), suggestion::nearest(group, all.clone(), str::to_lowercase)) {
                (true, _) => "the file has no names".to_owned(),
                (false, Some(meant)) => format!("did you mean {meant:?}? It has {}", listed(&all)),
                (false, None) => format!("it has {}", listed(&all)),
            };
        let problem = format!(
            "no object, group or material of the file is named \"{}\"",
            printed::line(group)
        );
        Err(Defect::new(problem, place))
    }

    /// That several parts were taken as one, in words.
    pub(super) fn merged(&self) -> Vec<String> {
        let distinct = |of: &dyn Fn(&Label) -> Option<String>| {
            let mut found: Vec<String> = Vec::new();
            for name in self.labels.iter().filter_map(of) {
                if !found.contains(&name) {
                    found.push(name);
                }
            }
            found
        };
        let objects = distinct(&|label| label.objects.last().cloned());
        let groups = distinct(&|label| label.groups.first().cloned());
        let materials = distinct(&|label| label.material.clone());
        let several = [("objects", objects), ("groups", groups), ("materials", materials)]
            .into_iter()
            .find(|(_, names)| names.len() > 1);
        let Some((kind, names)) = several else { return Vec::new() };
        let shown: Vec<&str> = names.iter().map(String::as_str).collect();
        vec![format!(
            "the file's {} {kind} become one object ({}); `group` selects one of them",
            names.len(),
            listed(&shown)
        )]
    }
}

fn listed(names: &[&str]) -> String {
    let shown = names.iter().take(MOST_NAMES_TOLD);
    let mut text = shown.map(|name| format!("\"{}\"", printed::line(name))).collect::<Vec<_>>();
    if names.len() > MOST_NAMES_TOLD {
        text.push(format!("{} more", names.len() - MOST_NAMES_TOLD));
    }
    text.join(", ")
}
