//! Fine structure with `sampling.refine = "device"`, against the rules of the host.

use super::on_device::{apart, of_objects, run};
use crate::support::{engine, engine_with};
use beamlet::scene::{Refine, Scene};
use beamlet::{Backend, EngineOptions};

/// Tolerance of the light that is compared.
const TOLERANCE: f64 = 1e-3;

/// A bundle of carbon fibres; a ray crosses up to 20.
fn fibres() -> Scene {
    of_objects(
        "[[object]]\nname = \"fibres\"\nmaterial = \"carbon\"\n\
         shape = { cylinder = { radius = \"6 um\", height = \"2 mm\" } }\n\
         [object.instances]\npacking = \"parallel-fibres\"\nfill = 0.3\nseed = 1\n\
         region = { cylinder = { radius = \"0.3 mm\", height = \"2 mm\" } }\n\
         [materials.carbon]\nformula = \"C\"\ndensity = \"1.8 g/cm3\"\n",
    )
}

/// Where rays differ by chance, rays of less light are split less: the mean light is up to half a tolerance too high.
#[test]
fn fine_structure_has_the_light_of_the_host() {
    let engine = engine(Backend::Bvh);
    let (want, _) = run(&engine, &fibres(), Refine::Host, TOLERANCE / 4.0);
    let (got, record) = run(&engine, &fibres(), Refine::Device, TOLERANCE);
    let [worst, rms] = apart(&got, &want);
    let mean = |stack: &ndarray::Array4<f32>| stack.mapv(f64::from).mean().expect("pixels");
    let off = mean(&got) - mean(&want);
    let told = record.sampling.expect("reported errors").worst_error;
    println!(
        "measured device, fibres: worst {worst:.1e}, rms {rms:.1e}, mean {off:.1e}, told {told:.1e}"
    );
    assert!(worst < 5.0 * TOLERANCE && rms < TOLERANCE, "{worst} {rms}");
    assert!(off.abs() < 0.5 * TOLERANCE, "{off}");
    assert!(told > worst / 6.0 && told <= TOLERANCE, "{told:e} for {worst:e}");
}

/// The number of rays of a patch does not depend on bands or batches.
#[test]
fn rays_of_fine_structure_are_the_same_in_bands_and_batches() {
    let of = |options: EngineOptions| {
        run(&engine_with(options.with_backend(Backend::Bvh)), &fibres(), Refine::Device, 4e-3).0
    };
    let whole = of(EngineOptions::default());
    for (what, options) in [
        ("bands", EngineOptions::default().with_band_rows(Some(1))),
        ("batches", EngineOptions::default().with_batch_rays(Some(4099))),
    ] {
        let other = of(options);
        assert!(whole.iter().zip(&other).all(|(a, b)| a.to_bits() == b.to_bits()), "{what}");
    }
}
