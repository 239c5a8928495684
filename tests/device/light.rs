//! Work of the kernels of light: long cell rows and random rays are shared among invocations.

use crate::support::{Checked, engine_with};
use beamlet::scene::Scene;
use beamlet::stack::Stacks;
use beamlet::{Backend, EngineOptions, KernelProfile};

const SET_UP: &str = r#"
source = { distance = "1.2 m", spot = ["30 um", "SPOT"], energy = "30 keV" }
detector = { distance = "1.8 m", pixels = [2, 1], pitch = "150 um" }
sample_mask = { distance = "1.1 m", transmission = 0.0, projected_aperture = "30 um" }
detector_mask = { transmission = 0.0, projected_aperture = "30 um" }
"#;

fn options() -> EngineOptions {
    EngineOptions::default().with_backend(Backend::Bvh)
}

/// Stacks of a scene, and the work of a kernel for them.
fn simulated(options: EngineOptions, text: &str, kernel: &str) -> (Stacks, KernelProfile) {
    let engine = engine_with(options);
    of_engine(&engine, text, kernel)
}

fn of_engine(engine: &Checked, text: &str, kernel: &str) -> (Stacks, KernelProfile) {
    let stacks = engine.simulate(&Scene::from_toml(text, ".").expect("a scene")).expect("stacks");
    let profile = engine.profile();
    (stacks, *profile.kernels.get(kernel).unwrap_or_else(|| panic!("no {kernel}: {profile:?}")))
}

/// Two pixels of a bundle of fibres that rays do not resolve have four cell rows of thousands of cells.
#[test]
fn rows_of_thousands_of_cells_fill_many_groups() {
    let text = SET_UP.replace("SPOT", "300 um")
        + r#"
[sampling]
tolerance = 2e-4
[scan]
mask_offsets = ["0 um"]
angles = ["7 deg"]
[[object]]
name = "fibres"
shape = { cylinder = { radius = "2.5 um", height = "2 mm" } }
material = "carbon"
roughness = 0.002
[object.instances]
packing = "parallel-fibres"
region = { cylinder = { radius = "0.2 mm", height = "2 mm" } }
count = 2000
gap = "0.12 um"
seed = 5
"#;
    let (_, light) = simulated(options(), &text, "illuminate_far");
    assert!(light.largest >= 12, "{light:?}");
}

fn random(rays: u32, offsets: &[&str]) -> String {
    let head = SET_UP.replace("SPOT", "30 um");
    format!(
        r#"{head}
[sampling]
scheme = "random"
transport = "first-order"
rays = {rays}
[scan]
mask_offsets = {offsets:?}
angles = ["20 deg", "20 deg"]
[[object]]
name = "rod"
shape = {{ cylinder = {{ radius = "0.1 mm", height = "3 mm" }} }}
material = "nylon-66"
rotate = [{{ axis = [0, 1, 0], angle = "20 deg" }}]
"#
    )
}

/// The rays of a pixel are shared among invocations, and so are mask steps, more than one of them has: no bit
/// depends on either, nor on batches.
#[test]
fn light_of_random_rays_is_shared_among_invocations() {
    let offsets: Vec<String> = (0..19).map(|step| format!("{} um", 2 * step - 18)).collect();
    let offsets: Vec<&str> = offsets.iter().map(String::as_str).collect();
    let engine = engine_with(options());
    let (all, light) = of_engine(&engine, &random(1000, &offsets), "random_light");
    assert!(light.largest >= 40, "{light:?}");
    for rays in [300, 4096] {
        let batches = options().with_batch_rays(rays);
        let (other, _) = simulated(batches, &random(1000, &offsets), "random_light");
        assert!(other.sample == all.sample && other.flat == all.flat, "{rays} rays of a batch");
    }
    // The first step of the second invocation, and the last one of all.
    for step in [8, 18] {
        let (alone, _) = of_engine(&engine, &random(1000, &offsets[step..=step]), "random_light");
        for ((view, _, row, column), got) in alone.sample.indexed_iter() {
            assert_eq!(got.to_bits(), all.sample[[view, step, row, column]].to_bits(), "{step}");
        }
    }
}

/// A batch of rays is made, traced and followed by its light with the next one: no buffer is made for it.
#[test]
fn a_batch_of_random_rays_is_one_submission_and_makes_no_buffer() {
    let engine = engine_with(options().with_batch_rays(1000));
    let work = |rays: u32| {
        let scene = Scene::from_toml(&random(rays, &["0 um"]), ".").expect("a scene");
        let before = engine.profile();
        engine.simulate(&scene).expect("stacks");
        let after = engine.profile();
        let batches = |profile: &beamlet::Profile| {
            profile.kernels.get("random_rays").map_or(0, |kernel| kernel.dispatches)
        };
        (after.traffic.since(before.traffic), batches(&after) - batches(&before))
    };
    work(1000);
    let ((few, few_batches), (many, many_batches)) = (work(2000), work(4000));
    assert_eq!(few.buffers, many.buffers);
    assert!(many_batches > few_batches + 15, "{few_batches} {many_batches}");
    let submissions = many.submissions - few.submissions;
    assert!(submissions <= (many_batches - few_batches) + 4, "{few:?} {many:?}");
}
