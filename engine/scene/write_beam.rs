//! The spectrum of the source as an inline table of TOML.

use super::write::{quantity, quoted};
use super::{Filter, SpectrumOrigin, SpectrumSpec};
use crate::units::Dimension::{Angle, Length, Voltage};

/// `file` is the path as it has to stand in the text, where the spectrum has one.
pub(super) fn spectrum(spec: &SpectrumSpec, file: Option<&str>) -> String {
    let mut parts = match &spec.origin {
        SpectrumOrigin::File { .. } => vec![format!("file = {}", quoted(file.unwrap_or_default()))],
        SpectrumOrigin::Tube { anode, kvp, anode_angle, inherent_filters } => vec![
            format!("anode = {}", quoted(anode.name())),
            format!("kvp = {}", quantity(*kvp, Voltage)),
            format!("anode_angle = {}", quantity(*anode_angle, Angle)),
            format!("inherent_filters = {}", filters(inherent_filters)),
        ],
    };
    parts.push(format!("filters = {}", filters(&spec.filters)));
    parts.extend(spec.nodes.map(|nodes| format!("nodes = {nodes}")));
    format!("{{ {} }}", parts.join(", "))
}

fn filters(filters: &[Filter]) -> String {
    let filter = |Filter { material, thickness }: &Filter| {
        let (material, thickness) = (quoted(material), quantity(*thickness, Length));
        format!("{{ material = {material}, thickness = {thickness} }}")
    };
    format!("[{}]", filters.iter().map(filter).collect::<Vec<_>>().join(", "))
}
