//! Built-in shapes as TOML.

use super::Shape;
use super::write::{list, quantity};
use crate::units::Dimension::Length;

/// The inline table of a shape.
pub(super) fn shape_table(shape: &Shape) -> String {
    let length = |value: f64| quantity(value, Length);
    let facets = |sides: Option<u32>| sides.map(|it| format!(", sides = {it}")).unwrap_or_default();
    let upright = |radius: f64, height: f64| {
        format!("radius = {}, height = {}", length(radius), length(height))
    };
    let (kind, keys) = match shape {
        Shape::Box { size } => ("box", format!("size = {}", list(size, Length))),
        Shape::Cylinder { radius, height, sides } => {
            ("cylinder", upright(*radius, *height) + &facets(*sides))
        }
        Shape::Cone { radius, top_radius, height, sides } => {
            let top = format!(", top_radius = {}", length(*top_radius));
            ("cone", upright(*radius, *height) + &top + &facets(*sides))
        }
        Shape::Prism { radius, height, sides } => {
            ("prism", upright(*radius, *height) + &facets(Some(*sides)))
        }
        Shape::Extrusion { points, height } => {
            let corners: Vec<_> = points.iter().map(|point| list(point, Length)).collect();
            let corners = corners.join(", ");
            ("extrusion", format!("points = [{corners}], height = {}", length(*height)))
        }
        Shape::Sphere { radius, sides } => {
            ("sphere", format!("radius = {}", length(*radius)) + &facets(*sides))
        }
        Shape::Ellipsoid { semi_axes, sides } => {
            ("ellipsoid", format!("semi_axes = {}", list(semi_axes, Length)) + &facets(*sides))
        }
        Shape::Torus { radius, tube_radius, sides } => {
            let [radius, tube] = [radius, tube_radius].map(|it| length(*it));
            let keys = format!("radius = {radius}, tube_radius = {tube}");
            ("torus", keys + &facets(*sides))
        }
    };
    format!("{{ {kind} = {{ {keys} }} }}")
}
