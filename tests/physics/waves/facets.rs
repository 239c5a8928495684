//! Facets that stand for a round body.

use super::{BY_WAVES, FIBRE, OFFSETS, add_cylinder, simulate};
use crate::thin_masks::REFERENCE;
use beamlet::check::Check;
use beamlet::scene::{Scene, Shape, ShapeOrMesh, Transport};
use beamlet::stack::Stacks;
use beamlet::{Backend, FacetKink};

/// Three rods of a radius (m) at places within an aperture, exact or with facets around.
fn scene(radius: f64, sides: Option<u32>) -> Scene {
    let mut scene = REFERENCE.scene(16, 0.001, &OFFSETS, BY_WAVES);
    for (number, place) in [-500.3e-6, -93e-6, 407e-6].into_iter().enumerate() {
        add_cylinder(&mut scene, place, radius, FIBRE);
        let rod = scene.objects.last_mut().expect("a rod");
        rod.name = format!("rod {number}");
        rod.geometry = ShapeOrMesh::Shape(Shape::Cylinder { radius, height: 4e-3, sides });
        rod.placement.rotate = vec![([0.0, 0.0, 1.0], 0.013 * place * 1e6)];
    }
    scene.sampling.tolerance = Some(2e-5);
    scene
}

/// Largest difference of the light.
fn apart(a: &Stacks, b: &Stacks) -> f64 {
    a.sample.iter().zip(&b.sample).map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max)
}

fn warned(scene: &Scene) -> Vec<String> {
    let report = Check::of(scene).without_estimate().run().expect("a report");
    report.warnings.into_iter().filter(|text| text.contains("diffract as edges")).collect()
}

#[test]
fn facets_that_diffract_as_edges_are_named_with_the_number_that_errs_by_less_than_1e_4() {
    for radius in [20e-6, 150e-6] {
        let exact = simulate(&scene(radius, None), Backend::Bvh);
        assert!(exact.record.facet_kinks.is_empty());
        let few = scene(radius, Some(20));
        let kinks: Vec<FacetKink> = simulate(&few, Backend::Bvh).record.facet_kinks;
        let texts = warned(&few);
        assert!(
            kinks.len() == 3 && texts == kinks.iter().map(ToString::to_string).collect::<Vec<_>>()
        );
        let sides = kinks[0].sides.expect("a number of sides");
        assert!(texts[0].contains(&format!("sides = {sides}, or an exact shape")), "{texts:?}");
        // δ/λ in cycles per length, the angle of 20 sides and the square of a side over the shear.
        let side = 2.0 * std::f64::consts::PI / 20.0;
        let bend = 2.0 * std::f64::consts::PI * FIBRE[0] / REFERENCE.set_up().wavelength;
        let want = bend * side * (side * radius).powi(2) / 0.286e-6;
        assert!((kinks[0].bend / want - 1.0).abs() < 0.05, "{} {want}", kinks[0].bend);
        let enough = scene(radius, Some(sides));
        let stacks = simulate(&enough, Backend::Bvh);
        assert!(stacks.record.facet_kinks.is_empty() && warned(&enough).is_empty());
        let error = apart(&stacks, &exact);
        println!("{radius:e}: {sides} sides err by {error:.1e}");
        assert!(error < 1e-4, "{radius:e}, {sides} sides: {error:e}");
    }
}

#[test]
fn facets_by_rays_and_prisms_by_waves_are_what_they_are() {
    let mut rays = scene(150e-6, Some(20));
    rays.sampling.transport = Transport::Auto;
    assert!(warned(&rays).is_empty());
    let mut prisms = scene(150e-6, Some(20));
    for rod in &mut prisms.objects {
        rod.geometry = ShapeOrMesh::Shape(Shape::Prism { radius: 150e-6, height: 4e-3, sides: 20 });
    }
    assert!(warned(&prisms).is_empty());
}
