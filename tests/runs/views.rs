//! Views in bands and alone: bits, counts, order and progress.

use crate::support::{Checked, engine_of};
use beamlet::ndarray::{ArrayView3, Axis};
use beamlet::scene::{Exposure, Scene};
use beamlet::stack::CallbackSink;
use beamlet::{Backend, Cancel, Control, EngineOptions, Error, Progress};
use std::ops::Range;

const SCENE: &str = concat!(
    include_str!("../support/paper.toml"),
    r#"pixels = [24, 4]
photons = 1000
[sampling]
tolerance = 1e-3
[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 5 }
angles = { from = "0 deg", to = "360 deg", count = 7 }

[[object]]
name = "rod"
shape = { cylinder = { radius = "0.4 mm", height = "1 mm" } }
material = "water"
position = ["0.3 mm", "0 mm", "0 mm"]

[[object]]
name = "bead"
shape = { sphere = { radius = "0.2 mm" } }
material = "PMMA"
position = ["-0.4 mm", "0.1 mm", "0 mm"]
roughness = 0.01
"#
);

fn scene() -> Scene {
    Scene::from_toml(SCENE, ".").unwrap()
}

fn engine(set: impl FnOnce(EngineOptions) -> EngineOptions) -> Checked {
    engine_of(set(EngineOptions::default().with_backend(Backend::Bvh)))
}

#[test]
fn bands_and_other_views_change_no_bit_of_a_view() {
    let mut scene = scene();
    (scene.sampling.tolerance, scene.sampling.angle_tolerance) = (Some(1e-2), Some(1e-6));
    scene.scan.angles.truncate(3);
    let whole = engine(|it| it);
    let found = whole.simulate(&scene).unwrap();
    let bands = engine(|it| it.with_band_rows(2)).simulate(&scene).unwrap();
    assert!(found.flat == bands.flat && found.sample == bands.sample);
    let counts = [&found, &bands].map(|stacks| stacks.counts.as_ref().unwrap());
    assert!(counts[0].sample == counts[1].sample && counts[0].dark == counts[1].dark);
    // The first view alone: draws of rough surfaces have the number of their view in their seed.
    let mut alone = scene.clone();
    alone.scan.angles.truncate(1);
    let view = whole.simulate(&alone).unwrap();
    assert!(view.sample.index_axis(Axis(0), 0) == found.sample.index_axis(Axis(0), 0));
}

/// Runs with a sink that fails at a view; the views that it got.
fn views_before(
    engine: &Checked,
    fails_at: Option<u32>,
    control: Control<'_>,
) -> (Vec<Exposure>, Option<Error>) {
    let mut views = Vec::new();
    let band = |view: Exposure, _: Range<u32>, _: ArrayView3<'_, f32>| {
        if fails_at.is_some_and(|index| view == Exposure::Sample(index)) {
            return Err(Error::Interrupted);
        }
        views.push(view);
        Ok(())
    };
    let mut sink = CallbackSink::new(band);
    let error = engine.run(&scene(), &mut sink, control).err();
    drop(sink);
    (views, error)
}

/// The flat and the first `count` views.
fn first(count: u32) -> Vec<Exposure> {
    std::iter::once(Exposure::Flat(0)).chain((0..count).map(Exposure::Sample)).collect()
}

#[test]
fn views_come_in_their_order_up_to_an_error_of_the_sink_or_the_end() {
    let engine = engine(|it| it);
    let (views, error) = views_before(&engine, None, Control::default());
    assert!(views == first(7) && error.is_none(), "{views:?} {error:?}");
    let (views, error) = views_before(&engine, Some(4), Control::default());
    assert!(views == first(4) && matches!(error, Some(Error::Interrupted)), "{views:?} {error:?}");
    let cancel = Cancel::default();
    let mut seen = Vec::new();
    let mut look = |progress: Progress| {
        if let Progress::Views(views) = progress {
            assert!(views.rows_done <= views.rows_total, "{views:?}");
            seen.push((views.view, views.share));
            if views.view == Exposure::Sample(2) {
                cancel.cancel();
            }
        }
    };
    let control = Control::default().with_progress(&mut look).with_cancel(cancel.clone());
    let (views, error) = views_before(&engine, None, control);
    assert!(views == first(2) && matches!(error, Some(Error::Interrupted)), "{views:?} {error:?}");
    assert!(seen.windows(2).all(|pair| pair[0].1 <= pair[1].1), "{seen:?}");
    let mut shown: Vec<Exposure> = seen.into_iter().map(|(view, _)| view).collect();
    shown.dedup();
    let flat_and_dark = shown.iter().filter(|view| !matches!(view, Exposure::Sample(_))).count();
    assert_eq!(shown[flat_and_dark..], first(3)[1..], "{shown:?}");
}
