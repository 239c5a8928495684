//! Colours of the materials of a scene, the same in every picture of it, and of labelled objects.

use super::colour::{Rgb, SET};
use crate::numbers;
use beamlet::scene::Scene;

/// Outside the sample.
pub(super) const EMPTY: Rgb = [255, 255, 255];

/// Materials of the objects in the order of the scene, each once.
pub(super) fn materials(scene: &Scene) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for object in &scene.objects {
        if !names.contains(&object.material.as_str()) {
            names.push(&object.material);
        }
    }
    names
}

/// Colour of a material of the sample.
pub(super) fn colour_of(scene: &Scene, material: &str) -> Rgb {
    let place = materials(scene).iter().position(|name| *name == material);
    place.map_or(EMPTY, nth)
}

/// Colour of the label of an object, from 1 on; 0 is the surroundings.
pub(crate) fn colour_of_label(label: u32) -> Rgb {
    label.checked_sub(1).map_or(EMPTY, |place| nth(place as usize))
}

/// The colours of the set, then darker and paler ones of them: 21 materials differ.
fn nth(place: usize) -> Rgb {
    let colour = SET[place % SET.len()];
    match place / SET.len() % 3 {
        0 => colour,
        1 => colour.map(|part| part / 2),
        _ => pale(colour, 0.45),
    }
}

/// Colour of an object; `None` are the surroundings.
pub(super) fn colour_of_object(scene: &Scene, object: Option<u32>) -> Rgb {
    object
        .and_then(|index| scene.objects.get(index as usize))
        .map_or(EMPTY, |object| colour_of(scene, &object.material))
}

/// Mixes a colour with white: 1 is the colour itself.
pub(super) fn pale(colour: Rgb, strength: f64) -> Rgb {
    colour.map(|c| numbers::whole::<u8>((255.0 - (255.0 - f64::from(c)) * strength).round()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twenty_one_materials_have_colours_that_differ() {
        let far = |a: Rgb, b: Rgb| a.iter().zip(b).map(|(a, b)| a.abs_diff(b)).max() > Some(24);
        for a in 0..21 {
            assert!((0..a).all(|b| far(nth(a), nth(b))), "{a}");
        }
    }
}
