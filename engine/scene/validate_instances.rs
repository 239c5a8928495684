//! Ranges of instances.

use super::validate::{Faults, count, not_negative, plain, positive};
use super::{
    Instances, Packing, PackingAmount, PackingKind, PackingRegion, Shape, ShapeOrMesh, limits,
};
use crate::units::Dimension::Length;
use crate::{Error, Result};

pub(super) fn validate_instances(
    key: &str,
    instances: &Instances,
    geometry: &ShapeOrMesh,
    faults: &mut Faults,
) {
    match instances {
        Instances::File(path) if path.as_os_str().is_empty() => {
            faults.add(Error::scene(key, "\"\"", "path of a file"));
        }
        Instances::File(_) => {}
        Instances::Packing(packing) => {
            validate_packing(key, packing, faults);
            faults.note(validate_packed_shape(key, packing, geometry));
        }
    }
}

fn validate_packing(table: &str, packing: &Packing, faults: &mut Faults) {
    let key = |key: &str| format!("{table}.{key}");
    let lengths: &[(&str, f64)] = match packing.region {
        PackingRegion::Box { size: [x, y, z] } => {
            &[("box.size[0]", x), ("box.size[1]", y), ("box.size[2]", z)]
        }
        PackingRegion::Cylinder { radius, height } => {
            &[("cylinder.radius", radius), ("cylinder.height", height)]
        }
        PackingRegion::Sphere { radius } => &[("sphere.radius", radius)],
    };
    for (name, length) in lengths {
        faults.note(positive(&key(&format!("region.{name}")), *length, Length));
    }
    match packing.amount {
        PackingAmount::Fill(fill) => {
            let most = packing.kind.most_fill();
            let allowed = format!("a number > 0, up to {most} for {}", packing.kind.word());
            faults.note(plain(&key("fill"), fill, fill > 0.0 && fill <= most, &allowed));
        }
        PackingAmount::Count(number) => {
            faults.note(count(&key("count"), number, 1, limits::INSTANCES));
        }
    }
    let (spread, most) = (packing.diameter_spread, limits::DIAMETER_SPREAD);
    let allowed = format!("a number from 0 to {most}, the standard deviation of ln(diameter)");
    let inside = (0.0..=most).contains(&spread);
    faults.note(plain(&key("diameter_spread"), spread, inside, &allowed));
    faults.note(not_negative(&key("gap"), packing.gap, Length));
}

/// Packings know how far two cylinders or spheres are apart, and of no other shape.
fn validate_packed_shape(table: &str, packing: &Packing, geometry: &ShapeOrMesh) -> Result<()> {
    let (found, is_packed) = match (geometry, packing.kind) {
        (ShapeOrMesh::Mesh(_), _) => ("a mesh", false),
        (ShapeOrMesh::Shape(Shape::Sphere { .. }), kind) => {
            ("a sphere", kind == PackingKind::Spheres)
        }
        (ShapeOrMesh::Shape(Shape::Cylinder { .. }), kind) => {
            ("a cylinder", kind != PackingKind::Spheres)
        }
        (ShapeOrMesh::Shape(_), _) => ("another shape", false),
    };
    if is_packed {
        return Ok(());
    }
    let found = format!("\"{}\" of {found}", packing.kind.word());
    let allowed = "\"spheres\" with shape = { sphere = ... }; \"parallel-fibres\" and \
                   \"random-fibres\" with shape = { cylinder = ... }; a file of positions with any";
    Err(Error::scene(format!("{table}.packing"), found, allowed))
}
