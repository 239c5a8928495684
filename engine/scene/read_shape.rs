//! Built-in shapes from the tree.

use super::table::{ListItem, Table};
use super::{Shape, limits};
use crate::Result;
use crate::units::Dimension::Length;

/// Stands for a shape that was refused.
pub(super) const NO_SHAPE: Shape = Shape::Sphere { radius: f64::NAN, sides: None };

pub(super) fn read_shape(item: &ListItem<'_>) -> Result<Shape> {
    let names = super::keys::keys_of("object.shape");
    let allowed = format!("one of {}, as {{ sphere = {{ ... }} }}", names.join(", "));
    let table = item.table("object.shape")?;
    let mut kinds = names.iter().filter_map(|kind| table.get(kind).map(|item| (*kind, item)));
    let Some((kind, item)) = kinds.next() else {
        return item.refuse(item.mismatch(&*allowed), NO_SHAPE);
    };
    for (_, other) in kinds {
        other.refuse(other.error("a second shape", &*allowed), ())?;
    }
    read_kind(kind, &item, "object.shape")
}

/// A shape of this kind, whose keys are those of the table `table`.KIND.
pub(super) fn read_kind(kind: &str, item: &ListItem<'_>, table: &str) -> Result<Shape> {
    let shape = item.table(&format!("{table}.{kind}"))?;
    let radius = || shape.quantity("radius", Length);
    let height = || shape.quantity("height", Length);
    Ok(match kind {
        "box" => Shape::Box { size: lengths(&shape, "size", "edge lengths along x, y and z")? },
        "sphere" => {
            Shape::Sphere { radius: radius()?, sides: sides(&shape, 4, limits::SPHERE_SIDES)? }
        }
        "ellipsoid" => Shape::Ellipsoid {
            semi_axes: lengths(&shape, "semi_axes", "half the extent along x, y and z")?,
            sides: sides(&shape, 4, limits::SPHERE_SIDES)?,
        },
        "torus" => Shape::Torus {
            radius: radius()?,
            tube_radius: shape.quantity("tube_radius", Length)?,
            sides: sides(&shape, 4, limits::SPHERE_SIDES)?,
        },
        "prism" => {
            let allowed = format!("a whole number from 3 to {}", limits::SIDES);
            let sides = shape.require("sides", allowed)?.integer(3..=limits::SIDES)?;
            Shape::Prism { radius: radius()?, height: height()?, sides }
        }
        "extrusion" => Shape::Extrusion { points: read_points(&shape)?, height: height()? },
        "cone" => Shape::Cone {
            radius: radius()?,
            top_radius: shape.optional_quantity("top_radius", Length)?.unwrap_or(0.0),
            height: height()?,
            sides: sides(&shape, 3, limits::SIDES)?,
        },
        _ => Shape::Cylinder {
            radius: radius()?,
            height: height()?,
            sides: sides(&shape, 3, limits::SIDES)?,
        },
    })
}

fn sides(shape: &Table<'_>, least: u32, most: u32) -> Result<Option<u32>> {
    shape.get("sides").map(|item| item.integer(least..=most)).transpose()
}

fn lengths(shape: &Table<'_>, key: &str, what: &str) -> Result<[f64; 3]> {
    let allowed = format!("{what}, such as [\"1 mm\", \"1 mm\", \"1 mm\"]");
    shape.require(key, &*allowed)?.array(&allowed, |item| item.quantity(Length))
}

fn read_points(shape: &Table<'_>) -> Result<Vec<[f64; 2]>> {
    let point = "a corner, such as [\"1 mm\", \"2 mm\"]";
    let allowed = "corners around a polygon, such as \
                   [[\"0 mm\", \"0 mm\"], [\"1 mm\", \"0 mm\"], [\"0 mm\", \"1 mm\"]]";
    let corners = shape.require("points", allowed)?.items(allowed)?;
    corners.iter().map(|item| item.array(point, |item| item.quantity(Length))).collect()
}
