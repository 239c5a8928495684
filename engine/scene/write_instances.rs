//! The resolved packing as TOML.

use super::write::{list, number, quantity, quoted};
use super::{Packing, PackingAmount, PackingRegion};
use crate::units::Dimension::Length;

pub(super) fn packing(packing: &Packing) -> String {
    let length = |value: f64| quantity(value, Length);
    let region = match packing.region {
        PackingRegion::Box { size } => format!("box = {{ size = {} }}", list(&size, Length)),
        PackingRegion::Cylinder { radius, height } => {
            format!("cylinder = {{ radius = {}, height = {} }}", length(radius), length(height))
        }
        PackingRegion::Sphere { radius } => format!("sphere = {{ radius = {} }}", length(radius)),
    };
    let amount = match packing.amount {
        PackingAmount::Fill(fill) => format!("fill = {}", number(fill)),
        PackingAmount::Count(count) => format!("count = {count}"),
    };
    let (kind, spread) = (quoted(packing.kind.word()), number(packing.diameter_spread));
    let (gap, seed) = (length(packing.gap), packing.seed);
    format!(
        "{{ packing = {kind}, region = {{ {region} }}, {amount}, diameter_spread = {spread}, \
         gap = {gap}, seed = {seed} }}"
    )
}
