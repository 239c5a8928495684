//! Smaller scenes of which a relation still fails.

use super::case::Case;
use beamlet::scene::{Beam, Detector, MaskBody, Normals};

/// Makes a case smaller, one part after another, as long as it fails.
pub(crate) fn shrunk(case: &Case, fails: &dyn Fn(&Case) -> bool) -> Case {
    let mut smallest = case.clone();
    while let Some(found) =
        smaller(&smallest).into_iter().find(|it| it.scene.validate().is_ok() && fails(it))
    {
        smallest = found;
    }
    smallest
}

fn places(case: &Case) -> usize {
    case.places.iter().map(Vec::len).sum()
}

/// Cases with one part less, the greatest parts first.
fn smaller(case: &Case) -> Vec<Case> {
    let mut all = Vec::new();
    let counting = Detector::new(1.0, [1; 2], [1.0; 2]).mode;
    let mut take = |change: &dyn Fn(&mut Case)| {
        let mut smaller = case.clone();
        change(&mut smaller);
        let other = smaller.scene != case.scene || smaller.roughness != case.roughness;
        if other || places(&smaller) != places(case) {
            all.push(smaller);
        }
    };
    for number in 0..case.places.len() {
        take(&|it| {
            it.scene.objects.remove(number);
            it.places.remove(number);
            it.roughness.remove(number);
        });
        for place in 0..case.places[number].len() {
            take(&|it| {
                it.places[number].remove(place);
            });
        }
    }
    take(&|it| it.scene.detector.blur = None);
    take(&|it| it.scene.detector.mode = counting);
    if case.scene.source.beam.single_energy().is_none() {
        take(&|it| it.scene.source.beam = Beam::Energy(30.0));
    }
    take(&|it| {
        it.scene.sample_mask = None;
        it.scene.scan.mask_offsets = vec![0.0];
        it.scene.scan.mask_offsets_z.clear();
    });
    take(&|it| it.scene.detector_mask = None);
    for step in 0..case.scene.scan.mask_offsets.len() {
        take(&|it| {
            it.scene.scan.mask_offsets.remove(step);
            if !it.scene.scan.mask_offsets_z.is_empty() {
                it.scene.scan.mask_offsets_z.remove(step);
            }
        });
    }
    let hard = MaskBody::Sheet { transmission: 0.0 };
    take(&|it| {
        if let Some(mask) = &mut it.scene.sample_mask {
            mask.body = hard.clone();
        }
    });
    take(&|it| {
        if let Some(mask) = &mut it.scene.detector_mask {
            mask.body = hard.clone();
        }
    });
    take(&|it| it.scene.source.spot = [0.0; 2].into());
    take(&|it| it.scene.scan.angles = vec![0.0]);
    for number in 0..case.places.len() {
        take(&|it| it.roughness[number] = 0.0);
        take(&|it| it.scene.objects[number].normals = Normals::Facets);
        take(&|it| it.scene.objects[number].placement.rotate.clear());
        take(&|it| it.scene.objects[number].placement.position = [0.0; 3]);
    }
    all
}
