//! Keys of instances: a file of positions, or a packing.

use super::prelude::*;
use crate::scene::{
    Instances, Packing, PackingAmount, PackingKind, PackingRegion, Shape, ShapeOrMesh,
};

/// Values that `instances` takes, in words.
pub(crate) const INSTANCES: &str =
    "path of a CSV file, or a packing { packing = \"spheres\", region = { ... }, fill = 0.3 }";

keys! { PACKING: Packing, "object.instances", [Forms(&[&["count"], &["fill"]], 1)], [];
    packing at Packing { kind: packing, .. } => Word(KINDS), Required, r#""spheres""#,
        "Bodies of the packing: fibres need a cylinder, spheres a sphere.";
    region => Inner(&REGION), Required, r#"{ sphere = { radius = "1 mm" } }"#,
        "Where, centred at the origin of the object.";
    fill at Packing { amount: PackingAmount::Fill(fill), .. } =>
        Number("a number", POSITIVE), Required, "0.3",
        "Share of the volume of the region, up to 0.5 (parallel fibres) or 0.35 (random fibres, spheres).";
    count at Packing { amount: PackingAmount::Count(count), .. } =>
        Count(1, limits::INSTANCES as u64), Required, "80000", "Number of copies.";
    diameter_spread => Number("a standard deviation of ln(diameter)", within(0.0, limits::DIAMETER_SPREAD)),
        Default("0.0"), "0.2", "How much diameters differ; 0 makes all equal.";
    gap => Quantity(Length, NOT_NEGATIVE), Default(r#""0 m""#), r#""0.1 um""#,
        "Least distance of two surfaces, and of a surface from the wall.";
    seed => Count(0, u64::MAX), Default("1"), "7", "Seed of the arrangement.";
}

words!(PackingKind, KINDS: "parallel-fibres" => ParallelFibres, "random-fibres" => RandomFibres,
    "spheres" => Spheres);

impl Record for Packing {
    const KEYS: &'static Keys<Self> = &PACKING;

    fn begin(has: &dyn Fn(&str) -> bool) -> Self {
        let amount = match has("count") {
            true => PackingAmount::Count(1),
            false => PackingAmount::Fill(f64::NAN),
        };
        Self::new(PackingKind::ParallelFibres, (REGIONS.none)(), amount)
    }

    fn relations(&self, key: &dyn Fn(&str) -> String, faults: &mut Faults) {
        let most = self.kind.most_fill();
        if let PackingAmount::Fill(fill) = self.amount
            && fill > most
        {
            let allowed = format!("a number > 0, up to {most} for {}", self.kind.word());
            faults.add(Error::scene(key("fill"), format!("{fill:?}"), allowed));
        }
    }
}

keys! { REGION, "object.instances.region",
    [Forms(&[&["box"], &["cylinder"], &["sphere"]], 0)], [];
    box => Inner(&BOX.spec), Required, r#"{ size = ["1 mm", "2 mm", "3 mm"] }"#, "Box.";
    cylinder => Inner(&CYLINDER.spec), Required, r#"{ radius = "1.25 mm", height = "1 mm" }"#,
        "Cylinder along z.";
    sphere => Inner(&SPHERE.spec), Required, r#"{ radius = "1 mm" }"#, "Sphere.";
}
keys! { BOX: PackingRegion, "object.instances.region.box", [], [];
    size at PackingRegion::Box { size } => Lengths("edge lengths along x, y and z", POSITIVE), Required,
        r#"["1 mm", "2 mm", "3 mm"]"#, "Edge lengths along x, y and z.";
}
keys! { CYLINDER: PackingRegion, "object.instances.region.cylinder", [], [];
    radius at PackingRegion::Cylinder { radius, .. } => Quantity(Length, POSITIVE), Required,
        r#""1.25 mm""#, "Radius.";
    height at PackingRegion::Cylinder { height, .. } => Quantity(Length, POSITIVE), Required,
        r#""1 mm""#, "Height.";
}
keys! { SPHERE: PackingRegion, "object.instances.region.sphere", [], [];
    radius at PackingRegion::Sphere { radius } => Quantity(Length, POSITIVE), Required, r#""1 mm""#,
        "Radius.";
}

static REGIONS: OneOf<PackingRegion> = OneOf {
    spec: &REGION,
    kinds: &[
        (&BOX, || PackingRegion::Box { size: [f64::NAN; 3] }),
        (&CYLINDER, || PackingRegion::Cylinder { radius: f64::NAN, height: f64::NAN }),
        (&SPHERE, || PackingRegion::Sphere { radius: f64::NAN }),
    ],
    none: || PackingRegion::Sphere { radius: f64::NAN },
};

impl Value for PackingRegion {
    fn read(item: &ListItem<'_>, _: &'static Row) -> Result<Self> {
        REGIONS.read(item)
    }

    fn write(&self, _: &Row, base: &Base<'_>) -> Result<Option<String>> {
        let (word, keys) = REGIONS.write(self, base)?;
        Ok(Some(format!("{{ {word} = {keys} }}")))
    }

    fn check(&self, key: &str, _: &Row, faults: &mut Faults) {
        REGIONS.check(self, key, faults);
    }
}

impl Value for Instances {
    fn read(item: &ListItem<'_>, row: &'static Row) -> Result<Self> {
        match item.is_table() {
            true => Packing::read(item, row).map(Self::Packing),
            false => PathBuf::read(item, row).map(Self::File),
        }
    }

    fn write(&self, row: &Row, base: &Base<'_>) -> Result<Option<String>> {
        match self {
            Self::File(path) => path.write(row, base),
            Self::Packing(packing) => packing.write(row, base),
        }
    }

    fn check(&self, key: &str, row: &Row, faults: &mut Faults) {
        match self {
            Self::File(path) => path.check(key, row, faults),
            Self::Packing(packing) => packing.check(key, row, faults),
        }
    }
}

/// Packings know how far two cylinders or spheres are apart, and of no other shape.
pub(crate) fn packed_shape(table: &str, packing: &Packing, geometry: &ShapeOrMesh) -> Result<()> {
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
                   \"random-fibres\" with shape = { cylinder = ... }; a file of positions with any shape";
    Err(Error::scene(format!("{table}.packing"), found, allowed))
}
