//! Keys of built-in shapes.

use super::prelude::*;
use super::series::read_file;
use crate::scene::{Shape, polygon};
use beamlet_core::csv_table::{Numbered, Quantities, TableKind};
use std::path::Path;

/// Placeholder of a refused shape.
pub(crate) const NO_SHAPE: Shape = Shape::Sphere { radius: f64::NAN, sides: None };
const EXACT: Need = Without("none: exact");
const FINE: Need = Without("none: facets within 10 nm");

keys! { SHAPE, "object.shape",
    [Forms(&[&["box"], &["cylinder"], &["cone"], &["prism"], &["extrusion"], &["sphere"],
             &["ellipsoid"], &["torus"], &["tube"]], 0)], [];
    box => Inner(&BOX.spec), Required, r#"{ size = ["1 mm", "2 mm", "3 mm"] }"#, "Box.";
    cylinder => Inner(&CYLINDER.spec), Required, r#"{ radius = "4 mm", height = "16 mm" }"#,
        "Cylinder along z.";
    cone => Inner(&CONE.spec), Required,
        r#"{ radius = "4 mm", height = "16 mm", top_radius = "1 mm" }"#, "Cone along z, or truncated cone.";
    prism => Inner(&PRISM.spec), Required, r#"{ radius = "4 mm", height = "16 mm", sides = 8 }"#,
        "Regular prism along z.";
    extrusion => Inner(&EXTRUSION.spec), Required,
        r#"{ points = [["0 mm", "0 mm"], ["3 mm", "0 mm"], ["0 mm", "1 mm"]], height = "5 mm" }"#,
        "Polygon drawn out along z.";
    sphere => Inner(&SPHERE.spec), Required, r#"{ radius = "1 mm" }"#, "Sphere.";
    ellipsoid => Inner(&ELLIPSOID.spec), Required, r#"{ semi_axes = ["1 mm", "2 mm", "3 mm"] }"#,
        "Ellipsoid.";
    torus => Inner(&TORUS.spec), Required, r#"{ radius = "4 mm", tube_radius = "1 mm" }"#,
        "Torus around z.";
    tube => Inner(&TUBE.spec), Required, r#"{ outer = "2 mm", inner = "1.5 mm", height = "20 mm" }"#,
        "Tube along z: a cylinder with a bore from end to end.";
}

keys! { BOX: Shape, "object.shape.box", [], [];
    size at Shape::Box { size } => Lengths("edge lengths along x, y and z", POSITIVE), Required,
        r#"["1 mm", "2 mm", "3 mm"]"#, "Edge lengths along x, y and z.";
}
keys! { CYLINDER: Shape, "object.shape.cylinder", [], [];
    radius at Shape::Cylinder { radius, .. } => Quantity(Length, POSITIVE), Required, r#""4 mm""#, "Radius.";
    height at Shape::Cylinder { height, .. } => Quantity(Length, POSITIVE), Required, r#""16 mm""#, "Height.";
    sides at Shape::Cylinder { sides, .. } => Count(3, limits::SIDES as u64), EXACT, "2048", "Facets around.";
}
keys! { CONE: Shape, "object.shape.cone", [], [];
    radius at Shape::Cone { radius, .. } => Quantity(Length, POSITIVE), Required, r#""4 mm""#,
        "Radius of the lower end, at −height/2.";
    height at Shape::Cone { height, .. } => Quantity(Length, POSITIVE), Required, r#""16 mm""#, "Height.";
    top_radius at Shape::Cone { top_radius, .. } => Quantity(Length, NOT_NEGATIVE), Default(r#""0 m""#),
        r#""1 mm""#, "Radius of the upper end; above 0 it makes a truncated cone.";
    sides at Shape::Cone { sides, .. } => Count(3, limits::SIDES as u64), EXACT, "2048", "Facets around.";
}
keys! { PRISM: Shape, "object.shape.prism", [], [];
    radius at Shape::Prism { radius, .. } => Quantity(Length, POSITIVE), Required, r#""4 mm""#,
        "Radius of the circle through the corners of the base.";
    height at Shape::Prism { height, .. } => Quantity(Length, POSITIVE), Required, r#""16 mm""#, "Height.";
    sides at Shape::Prism { sides, .. } => Count(3, limits::SIDES as u64), Required, "8", "Faces around.";
}
keys! { EXTRUSION: Shape, "object.shape.extrusion", [], [];
    points at Shape::Extrusion { points, .. } => Corners(limits::CORNERS), Required,
        r#"[["0 mm", "0 mm"], ["3 mm", "0 mm"], ["0 mm", "1 mm"]]"#,
        "Corners (x, y) in their order, either way round.";
    height at Shape::Extrusion { height, .. } => Quantity(Length, POSITIVE), Required, r#""5 mm""#, "Height.";
}
keys! { SPHERE: Shape, "object.shape.sphere", [], [];
    radius at Shape::Sphere { radius, .. } => Quantity(Length, POSITIVE), Required, r#""1 mm""#, "Radius.";
    sides at Shape::Sphere { sides, .. } => Count(4, limits::SPHERE_SIDES as u64), EXACT, "256",
        "Facets around the equator.";
}
keys! { ELLIPSOID: Shape, "object.shape.ellipsoid", [], [];
    semi_axes at Shape::Ellipsoid { semi_axes, .. } =>
        Lengths("half the extent along x, y and z", POSITIVE), Required, r#"["1 mm", "2 mm", "3 mm"]"#,
        "Half the extent along x, y and z.";
    sides at Shape::Ellipsoid { sides, .. } => Count(4, limits::SPHERE_SIDES as u64), EXACT, "256",
        "Facets around the equator.";
}
keys! { TORUS: Shape, "object.shape.torus", [], [];
    radius at Shape::Torus { radius, .. } => Quantity(Length, POSITIVE), Required, r#""4 mm""#,
        "Radius of the circle in the middle of the tube.";
    tube_radius at Shape::Torus { tube_radius, .. } => Quantity(Length, POSITIVE), Required, r#""1 mm""#,
        "Radius of the tube, less than `radius`.";
    sides at Shape::Torus { sides, .. } => Count(4, limits::SPHERE_SIDES as u64), FINE, "256",
        "Facets around the ring, and around the tube.";
}
keys! { TUBE: Shape, "object.shape.tube", [], [];
    outer at Shape::Tube { outer, .. } => Quantity(Length, POSITIVE), Required, r#""2 mm""#,
        "Radius of the outer wall.";
    inner at Shape::Tube { inner, .. } => Quantity(Length, POSITIVE), Required, r#""1.5 mm""#,
        "Radius of the bore, less than `outer`.";
    height at Shape::Tube { height, .. } => Quantity(Length, POSITIVE), Required, r#""20 mm""#, "Height.";
    sides at Shape::Tube { sides, .. } => Count(3, limits::SIDES as u64), EXACT, "2048",
        "Facets around, of each wall.";
}

const NAN: f64 = f64::NAN;

pub(crate) static SHAPES: OneOf<Shape> = OneOf {
    spec: &SHAPE,
    kinds: &[
        (&BOX, || Shape::Box { size: [NAN; 3] }),
        (&CYLINDER, || Shape::Cylinder { radius: NAN, height: NAN, sides: None }),
        (&CONE, || Shape::Cone { radius: NAN, top_radius: 0.0, height: NAN, sides: None }),
        (&PRISM, || Shape::Prism { radius: NAN, height: NAN, sides: 3 }),
        (&EXTRUSION, || Shape::Extrusion { points: Vec::new(), height: NAN }),
        (&SPHERE, || NO_SHAPE),
        (&ELLIPSOID, || Shape::Ellipsoid { semi_axes: [NAN; 3], sides: None }),
        (&TORUS, || Shape::Torus { radius: NAN, tube_radius: NAN, sides: None }),
        (&TUBE, || Shape::Tube { outer: NAN, inner: NAN, height: NAN, sides: None }),
    ],
    none: || NO_SHAPE,
};

impl Value for Shape {
    fn read(item: &ListItem<'_>, _: &'static Row) -> Result<Self> {
        SHAPES.read(item)
    }

    fn write(&self, _: &Row, base: &Base<'_>) -> Result<Option<String>> {
        let (word, keys) = SHAPES.write(self, base)?;
        Ok(Some(format!("{{ {word} = {keys} }}")))
    }

    fn check(&self, key: &str, _: &Row, faults: &mut Faults) {
        SHAPES.check(self, key, faults);
        let (less, more, names) = match self {
            Self::Torus { radius, tube_radius, .. } => {
                (tube_radius, radius, ["torus.tube_radius", "radius"])
            }
            Self::Tube { outer, inner, .. } => (inner, outer, ["tube.inner", "outer"]),
            _ => return,
        };
        if *less > 0.0 && less >= more {
            let allowed = format!("less than {}, {}", names[1], Length.rounded(*more));
            faults.add(Error::scene(format!("{key}.{}", names[0]), Length.rounded(*less), allowed));
        }
    }
}

/// Reads the ends of slits of a file.
fn read_ends(item: &ListItem<'_>, path: &Path) -> Result<Vec<[f64; 2]>> {
    let columns = "the columns end_0_UNIT and end_1_UNIT with a unit of length, as end_0_um";
    let kind = TableKind { key: "end", noun: "slits", columns, most: limits::SLITS as usize };
    let table = Quantities { kind, name: "end", dimension: Some(Length), columns: Numbered::Yes };
    read_arrays(item, path, table)
}

/// Reads the rows of a file, each with `N` lengths.
pub(super) fn read_arrays<const N: usize>(
    item: &ListItem<'_>,
    path: &Path,
    table: Quantities,
) -> Result<Vec<[f64; N]>> {
    let rows = read_file(item, path, |path| table.read(path), Vec::new())?;
    let array = |row: Vec<f64>| <[f64; N]>::try_from(row).ok();
    match rows.into_iter().map(array).collect::<Option<Vec<_>>>() {
        Some(rows) => Ok(rows),
        None => {
            let error = item.error("another number of columns", table.kind.columns);
            item.refuse(error, Vec::new())
        }
    }
}

/// Corners of a polygon, or ends of slits.
impl Value for Vec<[f64; 2]> {
    fn read(item: &ListItem<'_>, row: &'static Row) -> Result<Self> {
        let point = match row.kind {
            Corners(_) => "a corner, such as [\"1 mm\", \"2 mm\"]",
            _ => "both ends of a slit, such as [\"-30 um\", \"-10 um\"]",
        };
        if let (Some(path), Either(_, _, File(_))) = (item.as_text(), &row.kind) {
            return read_ends(item, Path::new(path));
        }
        let pair = |item: &ListItem<'_>| item.array(point, |item| item.quantity(Length));
        item.items(&row.allowed())?.iter().map(pair).collect()
    }

    fn write(&self, _: &Row, _: &Base<'_>) -> Result<Option<String>> {
        let pairs: Vec<_> = self.iter().map(|pair| list(pair, Length)).collect();
        Ok(Some(format!("[{}]", pairs.join(", "))))
    }

    /// Ends of slits are checked with their period.
    fn check(&self, key: &str, row: &Row, faults: &mut Faults) {
        if matches!(row.kind, Corners(_)) {
            polygon::validate(key, self, faults);
        }
    }
}
