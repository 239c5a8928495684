//! Built-in shapes in scene files.

use std::collections::BTreeMap;

use crate::paper::{PAPER, load};
use beamlet::Error;
use beamlet::scene::{Scene, Shape, ShapeOrMesh};

/// The paper's scene with another shape in place of its ball.
fn with_shape(shape: &str) -> Result<Scene, Error> {
    let ball = PAPER.lines().find(|line| line.starts_with("shape = ")).unwrap();
    load(&PAPER.replace(ball, &format!("shape = {{ {shape} }}")))
}

fn shape(scene: &Scene) -> &Shape {
    match &scene.objects[1].geometry {
        ShapeOrMesh::Shape(shape) => shape,
        ShapeOrMesh::Mesh(_) => panic!("a mesh"),
    }
}

const SQUARE: &str =
    r#"points = [["0 mm", "0 mm"], ["1 mm", "0 mm"], ["1 mm", "2 mm"], ["0 mm", "2 mm"]]"#;

#[test]
fn shapes_read_and_write_back_with_and_without_sides() {
    let sizes = r#"radius = "1 mm", height = "3 mm""#;
    let cases = [
        (
            format!("cylinder = {{ {sizes} }}"),
            Shape::Cylinder { radius: 1e-3, height: 3e-3, sides: None },
        ),
        (
            format!("cylinder = {{ {sizes}, sides = 12 }}"),
            Shape::Cylinder { radius: 1e-3, height: 3e-3, sides: Some(12) },
        ),
        (
            format!("cone = {{ {sizes} }}"),
            Shape::Cone { radius: 1e-3, top_radius: 0.0, height: 3e-3, sides: None },
        ),
        (
            format!("cone = {{ {sizes}, top_radius = \"0.5 mm\", sides = 6 }}"),
            Shape::Cone { radius: 1e-3, top_radius: 0.5e-3, height: 3e-3, sides: Some(6) },
        ),
        ("sphere = { radius = \"1 mm\" }".into(), Shape::Sphere { radius: 1e-3, sides: None }),
        (
            "ellipsoid = { semi_axes = [\"1 mm\", \"2 mm\", \"3 mm\"] }".into(),
            Shape::Ellipsoid { semi_axes: [1e-3, 2e-3, 3e-3], sides: None },
        ),
        (
            "torus = { radius = \"2 mm\", tube_radius = \"1 mm\", sides = 8 }".into(),
            Shape::Torus { radius: 2e-3, tube_radius: 1e-3, sides: Some(8) },
        ),
        (
            "tube = { outer = \"2 mm\", inner = \"1.5 mm\", height = \"3 mm\" }".into(),
            Shape::Tube { outer: 2e-3, inner: 1.5e-3, height: 3e-3, sides: None },
        ),
        (
            format!("extrusion = {{ {SQUARE}, height = \"1 mm\" }}"),
            Shape::Extrusion {
                points: vec![[0.0, 0.0], [1e-3, 0.0], [1e-3, 2e-3], [0.0, 2e-3]],
                height: 1e-3,
            },
        ),
    ];
    for (text, expected) in cases {
        let scene = with_shape(&text).unwrap();
        assert_eq!(shape(&scene), &expected);
        let written = scene.to_toml("somewhere", &BTreeMap::new(), &[]).unwrap();
        assert_eq!(load(&written).unwrap(), scene, "{written}");
        let table: toml::Table = written.parse().unwrap();
        let json = serde_json::to_string(&table).unwrap();
        assert_eq!(Scene::from_json(&json, "somewhere").unwrap(), scene);
    }
}

/// The scene with an extruded polygon.
fn extruded(points: &[[f64; 2]]) -> Result<(), Error> {
    let mut scene = load(PAPER)?;
    let extrusion = Shape::Extrusion { points: points.to_vec(), height: 1e-3 };
    scene.objects[1].geometry = extrusion.into();
    scene.validate()
}

#[test]
fn polygons_that_cross_or_touch_themselves_are_refused() {
    let good: [&[[f64; 2]]; 4] = [
        &[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
        // Clockwise, with a corner on a straight edge.
        &[[0.0, 0.0], [0.0, 2.0], [1.0, 2.0], [1.0, 1.0], [1.0, 0.0]],
        // A comb.
        &[
            [0.0, 0.0],
            [5.0, 0.0],
            [5.0, 3.0],
            [4.0, 3.0],
            [4.0, 1.0],
            [3.0, 1.0],
            [3.0, 3.0],
            [0.0, 3.0],
        ],
        &[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.5, 1e-9], [0.0, 1.0]],
    ];
    for points in good {
        for start in 0..points.len() {
            let turned = [&points[start..], &points[..start]].concat();
            extruded(&turned).unwrap_or_else(|error| panic!("{turned:?}: {error}"));
        }
    }
    let bad: [&[[f64; 2]]; 6] = [
        // A bow tie.
        &[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]],
        // No area.
        &[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]],
        // A corner twice.
        &[[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
        // An edge that folds back.
        &[[0.0, 0.0], [2.0, 0.0], [1.0, 0.0], [1.0, 1.0]],
        // A corner on another edge.
        &[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.5, 0.0], [0.0, 1.0]],
        // Two squares that share a corner.
        &[[0.0, 0.0], [1.0, 0.0], [1.0, 2.0], [2.0, 2.0], [2.0, 1.0], [0.0, 1.0]],
    ];
    for points in bad {
        for start in 0..points.len() {
            let turned = [&points[start..], &points[..start]].concat();
            let error = extruded(&turned).map(|()| format!("{turned:?}")).unwrap_err().to_string();
            assert!(error.contains("object[1].shape.extrusion.points"), "{error}");
            assert!(error.contains("does not cross or touch itself"), "{error}");
        }
    }
}
