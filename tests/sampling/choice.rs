//! Place where rays are chosen, `sampling.refine = "auto"`.

use crate::on_device::{meshes, shapes, tube};
use beamlet::internals::refine_choice::settle;
use beamlet::scene::{Refine, Scene, Scheme, Transport};
use beamlet::{Control, DeviceKind};
use std::path::Path;

/// Kinds of devices that are no processor.
const GPUS: [DeviceKind; 4] =
    [DeviceKind::Discrete, DeviceKind::Integrated, DeviceKind::Virtual, DeviceKind::Other];

/// Place where the rays of a scene are chosen, and why there.
fn choice(scene: &Scene, device: DeviceKind) -> (Refine, Option<String>) {
    let sample = beamlet::load_sample(scene, &mut Control::default()).expect("a sample");
    let mut scene = scene.clone();
    let reason = settle(&mut scene, &sample, device);
    (scene.sampling.refine, reason)
}

/// A bundle of exact fibres.
fn bundle(count: u32) -> Scene {
    let text = format!(
        "[source]\ndistance = \"1.2 m\"\nspot = \"20 um\"\nenergy = \"25 keV\"\n\
         [detector]\ndistance = \"1.8 m\"\npixels = [8, 2]\npitch = \"75 um\"\n\
         [[object]]\nname = \"fibres\"\nmaterial = \"Al\"\n\
         shape = {{ cylinder = {{ radius = \"2 um\", height = \"1 mm\" }} }}\n\
         [object.instances]\npacking = \"parallel-fibres\"\ncount = {count}\nseed = 1\n\
         region = {{ cylinder = {{ radius = \"50 um\", height = \"1 mm\" }} }}\n"
    );
    Scene::from_toml(&text, Path::new(".")).expect("a scene")
}

#[test]
fn gpus_choose_rays_and_cpus_leave_them_to_the_host() {
    let mut with_tube = shapes();
    with_tube.source.beam = tube(40.0, 4);
    let mut rough = with_tube.clone();
    rough.objects[0].roughness = 1e-3;
    let mut exact = with_tube.clone();
    exact.sampling.transport = Transport::Exact;
    for kind in GPUS {
        let (place, reason) = choice(&rough, kind);
        assert!(place == Refine::Host && reason.is_some_and(|it| it.contains("rough")));
    }
    for scene in [shapes(), with_tube, exact, bundle(65), meshes()] {
        assert_eq!(scene.sampling.refine, Refine::Auto, "the default");
        for kind in GPUS {
            let (place, reason) = choice(&scene, kind);
            assert_eq!(place, Refine::Device, "{reason:?}");
            assert!(reason.is_some_and(|it| it.contains("GPU")));
        }
        let (place, reason) = choice(&scene, DeviceKind::Cpu);
        assert_eq!(place, Refine::Host);
        assert!(reason.is_some_and(|it| it.contains("CPU")));
    }
}

#[test]
fn a_stated_place_is_kept_and_scenes_without_chosen_rays_have_no_reason() {
    for (place, kind) in [(Refine::Host, DeviceKind::Discrete), (Refine::Device, DeviceKind::Cpu)] {
        let mut scene = shapes();
        scene.sampling.refine = place;
        assert_eq!(choice(&scene, kind), (place, Some("by the scene".to_owned())));
    }
    let (mut random, mut waves, mut empty) = (shapes(), shapes(), shapes());
    random.sampling.scheme = Scheme::Random;
    waves.sampling.transport = Transport::Wave;
    empty.objects.clear();
    for scene in [random, waves, empty] {
        assert_eq!(choice(&scene, DeviceKind::Discrete), (Refine::Host, None));
    }
}
