//! Defects in words.

use super::found::{DefectCount, DefectPlace, Defects};
use crate::surface::rounded;
use std::fmt::{self, Display, Formatter};

impl Defects {
    /// Every kind with its name, those that get a mesh refused first.
    #[must_use]
    pub const fn kinds(&self) -> [(&'static str, &DefectCount); 8] {
        [
            ("open edges", &self.open_edges),
            ("non-manifold edges", &self.non_manifold_edges),
            ("edges between triangles that wind opposite ways", &self.flipped_edges),
            ("self-intersections", &self.self_intersections),
            ("non-manifold vertices", &self.non_manifold_vertices),
            ("degenerate triangles", &self.degenerate_triangles),
            ("duplicate triangles", &self.duplicate_triangles),
            ("triangles that are not finite", &self.not_finite),
        ]
    }

    /// Reasons why the mesh is refused; `apart`: least distance of corners at open edges, m.
    pub(crate) fn description(&self, apart: Option<f64>) -> String {
        let mut edges = listed(&[
            (&self.open_edges, "edge", "used by one triangle only (a hole or a gap)"),
            (
                &self.non_manifold_edges,
                "edge",
                "used by more than two triangles (parts that share an edge or a face)",
            ),
            (&self.flipped_edges, "edge", "between triangles that wind opposite ways"),
        ]);
        if let Some(apart) = apart {
            edges += &format!(", its nearest corners without an edge {} apart", rounded(apart));
        }
        let crossings = listed(&[(
            &self.self_intersections,
            "pair",
            "of triangles that pass through or lie on each other",
        )]);
        match (edges.is_empty(), crossings.is_empty()) {
            (false, true) => format!("the surface is not closed: {edges}"),
            (true, _) => format!("the surface crosses itself: {crossings}"),
            (false, false) => {
                format!("the surface is not closed: {edges}; and it crosses itself: {crossings}")
            }
        }
    }

    /// Where, kind by kind.
    pub(crate) fn places(&self) -> String {
        let mut text = String::new();
        for (name, found) in self.kinds().into_iter().filter(|(_, found)| found.count > 0) {
            text.push_str(&format!("\n  {name}, {found}"));
        }
        text
    }

    /// One sentence for each kind that does not get a mesh refused.
    pub(crate) fn warnings(&self) -> Vec<String> {
        let first = |found: &DefectCount| {
            found.places.first().map(|spot| format!("; the first: {spot}")).unwrap_or_default()
        };
        [
            (&self.degenerate_triangles, "triangle", "without area (harmless)"),
            (&self.duplicate_triangles, "triangle", "given twice"),
            (&self.non_manifold_vertices, "vertex", "where parts touch in a point (harmless)"),
        ]
        .into_iter()
        .filter(|(found, ..)| found.count > 0)
        .map(|kind| format!("{}{}", listed(&[kind]), first(kind.0)))
        .collect()
    }
}

/// Counts with their nouns, as in "3 edges used by one triangle only".
fn listed(kinds: &[(&DefectCount, &str, &str)]) -> String {
    let texts: Vec<String> = kinds
        .iter()
        .filter(|(found, ..)| found.count > 0)
        .map(|(found, noun, what)| match (found.count, *noun) {
            (1, noun) => format!("1 {noun} {what}"),
            (count, "vertex") => format!("{count} vertices {what}"),
            (count, noun) => format!("{count} {noun}s {what}"),
        })
        .collect();
    texts.join(", ")
}

/// The count, then a line for each place.
impl Display for DefectCount {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.count)?;
        if self.places.len() < self.count {
            write!(f, ", the first {}", self.places.len())?;
        }
        write!(f, ":")?;
        self.places.iter().try_for_each(|spot| write!(f, "\n    {spot}"))
    }
}

impl Display for DefectPlace {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let plural = if self.triangles.len() == 1 { "" } else { "s" };
        let numbers: Vec<String> = self.triangles.iter().map(u32::to_string).collect();
        write!(f, "triangle{plural} {}", numbers.join(" and "))?;
        match self.position_mm {
            Some(position) => {
                // Rounding leaves no negative zeros.
                let [x, y, z] = position.map(|mm| (mm * 1e6).round() / 1e6 + 0.0);
                write!(f, " at ({x:.6}, {y:.6}, {z:.6}) mm")
            }
            None => Ok(()),
        }
    }
}
