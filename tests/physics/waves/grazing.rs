//! Surfaces below the critical angle by waves.

use super::{BY_WAVES, OFFSETS, engine};
use crate::support::backends;
use crate::thin_masks::REFERENCE;
use beamlet::scene::{MaterialSpec, Object, Scene, Shape};

/// Largest spacing of rays at the default tolerance, m (docs/waves.md).
const SPACING: f64 = 55e-9;
const DEPTH: f64 = 10e-3;

/// A block whose left face is in the middle of the aperture of the middle column, turned from the beam by an angle.
fn scene(angle: f64) -> Scene {
    let mut scene = REFERENCE.scene(3, 0.012, &OFFSETS, BY_WAVES);
    // Its critical angle is 1.4 mrad.
    scene.materials.insert("matter".into(), MaterialSpec::Constants { mu: 0.0, delta: 1e-6 });
    let shape = Shape::Box { size: [2e-3, DEPTH, 4e-3] };
    let mut block = Object::new("block", shape, "matter");
    block.placement.rotate.push(([0.0, 0.0, 1.0], angle));
    block.placement.position = [1e-3, 0.0, 0.0];
    scene.objects.push(block);
    scene
}

/// Every ray on the face is counted once, in the line of the row and, where this patch estimates the error of the
/// spacing, twice more in the finer one.
#[test]
fn rays_on_a_face_below_the_critical_angle_are_counted() {
    for backend in backends() {
        let engine = engine(backend);
        let reflected =
            |angle| engine.simulate(&scene(angle)).expect("stacks").record.tally.reflected;
        for angle in [0.3e-3, -0.8e-3_f64] {
            let of_line = DEPTH * angle.abs() / SPACING;
            let found = reflected(angle) as f64;
            assert!(
                found > 0.95 * of_line && found < 3.3 * of_line,
                "{angle}: {found} of {of_line}"
            );
        }
        assert_eq!(reflected(1.6e-3), 0);
        assert_eq!(reflected(-3e-3), 0);
    }
}
