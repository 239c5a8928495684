//! Waves of short wavelength, and of samples that refract evenly, against rays.

use super::{BY_WAVES, FIBRE, add_cylinder, row, simulate};
use crate::reference::normal::SIGMA_PER_FWHM;
use crate::reference::waves::body::{Body, Outline};
use crate::reference::waves::light::Case;
use crate::reference::waves::rays;
use crate::reference::waves::setup::Slits;
use crate::support::sample;
use crate::thin_masks::REFERENCE;
use beamlet::Backend;
use beamlet::scene::{Beam, MaterialSpec, Object, Shape, Transport};
use beamlet::stack::Stacks;
use std::f64::consts::{PI, SQRT_2};

/// A cylinder (x of its axis and its radius, m), `behind` the mask (m), at an energy (keV).
fn light(energy: f64, (centre, radius, behind): (f64, f64, f64), transport: Transport) -> Stacks {
    let mut scene = REFERENCE.scene(4, behind, &[5e-6], BY_WAVES);
    scene.source.beam = Beam::Energy(energy);
    add_cylinder(&mut scene, centre, radius, FIBRE);
    scene.sampling.transport = transport;
    scene.sampling.tolerance = Some(2e-6);
    simulate(&scene, Backend::Bvh)
}

#[test]
fn waves_become_rays_at_a_rim_as_the_root_of_the_wavelength() {
    // Change of the light of a pixel by a fibre, less the change by rays in f64.
    let error = |energy: f64| {
        let stacks = light(energy, (54e-6, 10e-6, 0.0001), Transport::Wave);
        let change = f64::from(stacks.sample[[0, 0, 0, 2]]) - f64::from(stacks.flat[[0, 0, 2]]);
        let mut set_up = REFERENCE.set_up();
        set_up.sample = 1.2001;
        let slits = Slits::one(20e-6);
        let outline = Outline::Cylinder { centre: 4e-6, radius: 10e-6 };
        let sample = [Body { outline, delta: FIBRE[0], mu: FIBRE[1] }];
        let flat =
            Case { setup: &set_up, slits: Some(&slits), sample: &[], window: REFERENCE.window() };
        let case = Case { sample: &sample, ..flat };
        let by_rays = |case: &Case<'_>| rays::curve(case, 1e-4, 64, &[5e-6])[0];
        (change - by_rays(&case) + by_rays(&flat)).abs()
    };
    let errors = [30.0, 300.0].map(error);
    // Light of rays nearer to a rim than a shear, where slopes grow as d^(-1/2).
    let ratio = errors[1] / errors[0];
    assert!((ratio - 0.1_f64.sqrt()).abs() < 0.05, "{ratio} {errors:?}");
    assert!((errors[0] - 1e-4).abs() < 2e-5, "{errors:?}");
}

#[test]
fn interiors_of_large_bodies_have_the_light_of_rays() {
    let normalized = |energy: f64, transport| {
        let stacks = light(energy, (13e-6, 2e-3, 0.003), transport);
        let of = |column| f64::from(stacks.sample[[0, 0, 0, column]] / stacks.flat[[0, 0, column]]);
        [0, 1, 2, 3].map(of)
    };
    let error = |energy: f64| {
        let [waves, rays] = [Transport::Wave, Transport::Auto].map(|by| normalized(energy, by));
        waves.iter().zip(&rays).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    // The slope of the flat curve differs by parts of a percent, and falls with the wavelength.
    let errors = [30.0, 300.0, 1000.0].map(error);
    assert!(errors[0] < 3e-5 && errors[1] < 5e-6 && errors[2] < 2e-6, "{errors:?}");
}

/// An opaque slab whose edge covers that of an aperture, some distance behind the mask. Waves neglect propagation over
/// it and the motion of the sample by the focal spot beyond its first order: the light beyond the edges of their images
/// is √(λd/2)/(2π) (Fresnel) and σ/√(2π), which a warning states as its size.
#[test]
fn light_between_mask_and_sample_errs_by_the_size_that_the_warning_states() {
    // The nearest and the farthest; all with `BEAMLET_ALL`.
    for (behind, stated) in sample(vec![(0.01, 8.4e-4), (0.03, 1.76e-3), (0.1, 4.5e-3)], 2) {
        let mut scene = REFERENCE.scene(4, behind, &[-10e-6], BY_WAVES);
        scene.materials.insert("lead".into(), MaterialSpec::Constants { mu: 1e7, delta: 0.0 });
        let low = 50e-6 * (1.2 + behind) / 1.2;
        let shape = Shape::Box { size: [60e-6, 10e-6, 4e-3] };
        let mut object = Object::new("slab", shape, "lead");
        object.placement.position = [low + 30e-6, 0.0, 0.0];
        scene.objects.push(object);
        let stacks = simulate(&scene, Backend::Bvh);
        let mut set_up = REFERENCE.set_up();
        set_up.sample = 1.2 + behind;
        let outline = Outline::Slab { low, high: low + 60e-6, thickness: 10e-6 };
        let slab = [Body { outline, delta: 0.0, mu: 1e7 }];
        let want = row(&REFERENCE, 4).light(&set_up, &slab, 10e-9, &[-10e-6], Some(64));
        let error = |column: usize| f64::from(stacks.sample[[0, 0, 0, column]]) - want[0][column];
        let worst = (0..4).map(|column| error(column).abs()).fold(0.0, f64::max);
        let motion = 30e-6 * SIGMA_PER_FWHM * behind / (1.2 + behind);
        let spread = (set_up.wavelength * behind).sqrt();
        let size = (spread / (2.0 * SQRT_2 * PI)).hypot(motion / (2.0 * PI).sqrt()) / 100e-6;
        assert!((size / stated - 1.0).abs() < 0.02, "{behind}: {size:e}");
        assert!((0.7..1.0).contains(&(worst / size)), "{behind}: {worst:e} of {size:e}");
    }
}
