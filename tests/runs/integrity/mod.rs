//! The real program on runs that lost something or whose inputs changed: what is damaged is made
//! again and named, nothing whole is touched, and two beams are never mixed.
#![cfg(feature = "cli")]

mod derived;
mod npy;
mod reading;
mod referenced;
mod tally;

/// The set-up of the paper around a rod, 4 views of 2 steps.
pub(crate) const SCENE: &str = concat!(
    include_str!("../../support/paper.toml"),
    r#"pixels = [8, 2]
[sampling]
tolerance = 1e-2
angle_tolerance = "1 urad"
[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 2 }
angles = { from = "0 deg", to = "360 deg", count = 4 }

"#,
    include_str!("../../support/rod.toml")
);

#[track_caller]
pub(crate) fn assert_says(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "no \"{part}\" in: {message}");
    }
}
