//! Keys of the objects and of the region of the surroundings.

use super::packing::{INSTANCES, PACKING, packed_shape};
use super::prelude::*;
use super::shape::{BOX, CYLINDER, NO_SHAPE, SHAPE};
use crate::scene::{Instances, Mesh, MeshFormat, Normals, Object, Placement, ShapeOrMesh};

const MESH: Kind = File("path of a file");
const NO_SIZE: &str = "the length of 1.0 in the mesh file, such as \"mm\" or \"25.4 mm\"";
const LENGTHS: Kind = Lengths("three lengths", ANY);
const ORIGIN: Need = Default(r#"["0 m", "0 m", "0 m"]"#);
const SCALE: Kind = Number("a number", POSITIVE);
const GROUP: Kind = Name("name of an object, group or material of the file");

keys! { OBJECT: Object, "object", [Forms(&[&["shape"], &["mesh", "unit", "group", "sha256"]], 1)],
    ["file" => "mesh", "stl" => "mesh", "path" => "mesh", "translate" => "position",
     "rotation" => "rotate"];
    name => Name("a unique name"), Required, r#""rod""#, "Unique name.";
    mesh at Object { geometry: ShapeOrMesh::Mesh(Mesh::File { path: mesh, .. }), .. } =>
        MESH, Required, r#""rod.stl""#, "A closed triangle mesh: .stl, .obj, .ply, .3mf.";
    unit at Object { geometry: ShapeOrMesh::Mesh(Mesh::File { unit, .. }), .. } =>
        Unit, Without("required with `mesh`; none for 3MF"), r#""mm""#,
        "Length of 1.0 in the mesh file: a unit, `\"inch\"`, or a length such as `\"25.4 mm\"`.";
    group at Object { geometry: ShapeOrMesh::Mesh(Mesh::File { group, .. }), .. } =>
        GROUP, Without("all of the file"), r#""lens""#,
        "An object, group or material of an OBJ or 3MF file.";
    sha256 at Object { geometry: ShapeOrMesh::Mesh(_), sha256, .. } =>
        Hash, Without("not checked"), "written by a run", "Hash of the mesh file.";
    shape at Object { geometry: ShapeOrMesh::Shape(shape), .. } =>
        Inner(&SHAPE), Required, r#"{ sphere = { radius = "1 mm", sides = 256 } }"#, "A built-in shape.";
    allow_defects => Flag, Default("false"), "true", "Accepts a mesh that is open or crosses itself.";
    material => MATERIAL, Required, r#""carbon""#, "Its material.";
    center at Object { placement: Placement { center, .. }, .. } => Flag, Default("false"), "true",
        "Moves the centre of the bounding box to the mesh origin.";
    scale at Object { placement: Placement { scale, .. }, .. } => SCALE, Default("1.0"), "0.5",
        "Scale about the mesh origin.";
    rotate at Object { placement: Placement { rotate, .. }, .. } => Tables(&ROTATE.spec), Default("[]"),
        r#"[{ axis = [0, 0, 1], angle = "30 deg" }]"#, "Rotations about the mesh origin.";
    position at Object { placement: Placement { position, .. }, .. } => LENGTHS, ORIGIN,
        r#"["0 mm", "0 mm", "2 mm"]"#, "Translation; the sample fits between the masks.";
    instances => Either(INSTANCES, &File("path of a CSV file"), &Inner(&PACKING.spec)), Without("one copy"),
        r#""positions.csv""#, "Many copies: a file of positions, or a packing.";
    roughness => Number("a standard deviation of slopes", within(0.0, limits::ROUGHNESS)), Default("0.0"), "0.002",
        "Standard deviation of the slopes of the surface.";
    correlation_length => Quantity(Length, POSITIVE), Without("none: slopes alone"), r#""5 um""#,
        "Correlation length of the heights of a rough surface, for waves; rays take slopes alone.";
    normals => Word(NORMALS), Default(r#""facets""#), r#""smooth""#,
        "Normals that refract light; smooth normals of facets only.";
}

words!(Normals, NORMALS: "facets" => Facets, "smooth" => Smooth);

impl Record for Object {
    const KEYS: &'static Keys<Self> = &OBJECT;

    fn begin(has: &dyn Fn(&str) -> bool) -> Self {
        let mesh = Mesh::File { path: PathBuf::new(), unit: None, group: None };
        Self::new("", if has("shape") { NO_SHAPE.into() } else { ShapeOrMesh::Mesh(mesh) }, "")
    }

    fn leaves_out(&self, key: &str) -> bool {
        match key {
            "allow_defects" => {
                matches!(self.geometry, ShapeOrMesh::Shape(_)) && !self.allow_defects
            }
            "roughness" => self.roughness <= 0.0,
            "normals" => self.normals == Normals::Facets,
            "sha256" => matches!(self.geometry, ShapeOrMesh::Mesh(Mesh::Arrays { .. })),
            _ => false,
        }
    }

    fn comments(&self, key: &str) -> Vec<String> {
        let ShapeOrMesh::Mesh(Mesh::Arrays { vertices, triangles }) = &self.geometry else {
            return Vec::new();
        };
        if key != "mesh" {
            return Vec::new();
        }
        let (vertices, triangles) = (vertices.len(), triangles.len());
        let arrays = format!("mesh given as arrays: {vertices} vertices, {triangles} triangles");
        let hash = self.sha256.as_ref().map(|hash| format!("sha256 {hash}"));
        [arrays].into_iter().chain(hash).collect()
    }

    fn relations(&self, key: &dyn Fn(&str) -> String, faults: &mut Faults) {
        match &self.geometry {
            ShapeOrMesh::Mesh(mesh) => check_mesh(mesh, key, faults),
            ShapeOrMesh::Shape(shape) if self.normals == Normals::Smooth && !shape.has_facets() => {
                let allowed = "\"facets\": this shape has its exact surface; smooth normals are for \
                               shapes with `sides` and meshes";
                faults.add(Error::scene(key("normals"), "\"smooth\"", allowed));
            }
            ShapeOrMesh::Shape(_) => {}
        }
        if let Some(Instances::Packing(packing)) = &self.instances {
            faults.note(packed_shape(&key("instances"), packing, &self.geometry));
        }
    }
}

/// Formats of mesh files differ in whether they have units and groups.
fn check_mesh(mesh: &Mesh, key: &dyn Fn(&str) -> String, faults: &mut Faults) {
    let Mesh::File { path, unit, group } = mesh else { return };
    let format = MeshFormat::of(path);
    if let (Some(group), Some(false)) = (group, format.map(MeshFormat::has_groups)) {
        let allowed = "no group: only OBJ and 3MF files name their parts";
        faults.add(Error::scene(key("group"), format!("{group:?}"), allowed));
    }
    match (unit, format.is_some_and(MeshFormat::has_unit)) {
        (Some(unit), false) => {
            faults.note(in_range(&key("unit"), &Quantity(Length, POSITIVE), *unit))
        }
        (Some(unit), true) => {
            let allowed = "no unit: 3MF files state it; `scale` corrects a wrong one";
            faults.add(Error::scene(key("unit"), Length.rounded(*unit), allowed));
        }
        (None, false) if !path.as_os_str().is_empty() => {
            faults.add(Error::scene(key("unit"), "nothing: the key is missing", NO_SIZE));
        }
        (None, _) => {}
    }
}

keys! { ROTATE: ([f64; 3], f64), "object.rotate", [], [];
    axis at (axis, _) => Direction, Required, "[0, 0, 1]", "Axis, of any length > 0.";
    angle at (_, angle) => Quantity(Angle, ANY), Required, r#""30 deg""#, "Angle of a right-handed rotation.";
}

impl Record for ([f64; 3], f64) {
    const KEYS: &'static Keys<Self> = &ROTATE;

    fn begin(_: &dyn Fn(&str) -> bool) -> Self {
        ([f64::NAN; 3], f64::NAN)
    }
}

keys! { SURROUNDINGS, "surroundings", [], [];
    material => MATERIAL, Without("material of the path; required with `region`"), r#""water""#,
        "Material around the objects, or of the region.";
    path_material => MATERIAL, Default(r#""vacuum""#), r#""air""#,
        "Material between the source and the detector.";
    region => Inner(&REGION.spec), Without("none: without end"),
        r#"{ box = { size = ["20 mm", "10 mm", "30 mm"] } }"#, "Region that the material fills.";
}

keys! { REGION: Object, "surroundings.region",
    [Forms(&[&["box"], &["cylinder"], &["mesh", "unit", "group", "sha256"]], 0)], [];
    box by hand => Inner(&BOX.spec), Required, r#"{ size = ["20 mm", "10 mm", "30 mm"] }"#, "Box.";
    cylinder by hand => Inner(&CYLINDER.spec), Required, r#"{ radius = "8 mm", height = "30 mm" }"#,
        "Cylinder along z.";
    mesh at Object { geometry: ShapeOrMesh::Mesh(Mesh::File { path: mesh, .. }), .. } =>
        MESH, Required, r#""tank.stl""#, "A closed triangle mesh: .stl, .obj, .ply, .3mf.";
    unit at Object { geometry: ShapeOrMesh::Mesh(Mesh::File { unit, .. }), .. } =>
        Unit, Without("required with `mesh`; none for 3MF"), r#""mm""#,
        "Length of 1.0 in the mesh file: a unit, or a length.";
    group at Object { geometry: ShapeOrMesh::Mesh(Mesh::File { group, .. }), .. } =>
        GROUP, Without("all of the file"), r#""water""#,
        "An object, group or material of an OBJ or 3MF file.";
    sha256 at Object { geometry: ShapeOrMesh::Mesh(_), sha256, .. } =>
        Hash, Without("not checked"), "written by a run", "Hash of the mesh file.";
    center at Object { placement: Placement { center, .. }, .. } => Flag, Default("false"), "true",
        "Moves the centre of the bounding box to the mesh origin.";
    scale at Object { placement: Placement { scale, .. }, .. } => SCALE, Default("1.0"), "0.5",
        "Scale about the mesh origin.";
    rotate at Object { placement: Placement { rotate, .. }, .. } => Tables(&ROTATE.spec), Default("[]"),
        r#"[{ axis = [0, 0, 1], angle = "30 deg" }]"#, "Rotations about the mesh origin.";
    position at Object { placement: Placement { position, .. }, .. } => LENGTHS, ORIGIN,
        r#"["0 mm", "0 mm", "2 mm"]"#, "Translation; the region fits between the masks.";
}
