//! Lever arms of voxels before and behind the axis of rotation in filtered back-projection.

use crate::reference::blobs::Blob;
use crate::set_up::{PIXEL, blobs, deviation, fan, grid, reconstruct, sinograms};
use beamlet::reconstruct::{FbpOptions, Quantity};

/// Contrast of a feature at radius r is off by up to 2 r/(π lever) without, here 2.5 %.
#[test]
fn short_scans_are_corrected_for_lever_arms() {
    let mut geometry = fan(118);
    geometry.lever = 0.03;
    let grid = grid([56, 56, 1]);
    for (quantity, factor) in [(Quantity::Delta, 1.0), (Quantity::DarkField, 2.0)] {
        let sinograms = sinograms(&geometry, &blobs(), quantity);
        let error = |passes: Option<usize>| {
            let options = FbpOptions::default().with_arm_passes(passes);
            let volume = reconstruct(&geometry, &sinograms, quantity, &grid, &options).unwrap();
            deviation(&volume, &blobs())
        };
        let [none, one, two, usual] = [Some(0), Some(1), Some(2), None].map(error);
        println!("measured {quantity:?}: {none:.2e}, {one:.2e} after a pass, {two:.2e} after two");
        assert!(none > 5e-3 * factor, "{none}");
        // Interpolation leaves 5e-4 of it, the width of the blobs the rest.
        assert!(one < 2e-3 * factor && two < 2e-3 * factor, "{one} {two}");
        assert!((one - usual).abs() <= 0.0);
    }
}

#[test]
fn whole_turns_and_attenuation_take_no_pass() {
    let mut geometry = fan(180);
    geometry.lever = 0.03;
    let grid = grid([56, 56, 1]);
    let small = [Blob { sigma: 6.0 * PIXEL, ..blobs()[0] }];
    let sinograms = sinograms(&geometry, &small, Quantity::Delta);
    let made = |passes: Option<usize>| {
        let options = FbpOptions::default().with_arm_passes(passes);
        reconstruct(&geometry, &sinograms, Quantity::Delta, &grid, &options).unwrap().values
    };
    assert_eq!(made(None), made(Some(0)));
    // Over a turn what arms do to a feature cancels, but for its own extent.
    let options = FbpOptions::default().with_arm_passes(0);
    let volume = reconstruct(&geometry, &sinograms, Quantity::Delta, &grid, &options).unwrap();
    assert!(deviation(&volume, &small) < 2e-3, "{}", deviation(&volume, &small));
}
