//! Objects of a scene at the voxels of a volume.

use crate::Engine;
use beamlet_core::cancel::Cancel;
use beamlet_core::numbers::single;
use beamlet_core::{Error, Result, reserve};
use beamlet_model::scene::Scene;
use beamlet_recon::reconstruct::{ScanGeometry, Truth, VolumeGrid};
use beamlet_simulate::run::Control;
use beamlet_simulate::trace::{Ray, SurfaceCrossing};
use ndarray::Array3;

/// Surfaces along a line of voxels, at most: first, and where these are not enough.
const MOST: [u32; 2] = [64, 1024];

/// The objects of a scene on the voxels of a grid as in a run: overlaps resolved, inner ones inside of outer
/// ones. Constants at the energy, or means over the spectrum of the light that masks modulate, minus the
/// surroundings'.
///
/// # Errors
/// As [`Engine::prepare`]; [`Error::Argument`] for a geometry or grid that cannot be, more than 65,535
/// objects, and lines through more than 1024 surfaces; [`Error::Interrupted`].
pub fn truth(
    engine: &Engine,
    scene: &Scene,
    geometry: &ScanGeometry,
    grid: &VolumeGrid,
    cancel: &Cancel,
) -> Result<Truth> {
    Truth::with_labels(scene, geometry, grid, |upright| labels(engine, upright, grid, cancel))
}

/// Objects at the centres of the voxels, by lines along y.
fn labels(
    engine: &Engine,
    scene: &Scene,
    grid: &VolumeGrid,
    cancel: &Cancel,
) -> Result<Array3<u16>> {
    let [x, y, z] = grid.size;
    let values = reserve::zeroed(x * y * z, "labels of voxels")?;
    let mut labels = Array3::from_shape_vec((z, y, x), values)
        .map_err(|error| Error::argument("grid", error.to_string(), "its number of voxels"))?;
    if scene.objects.is_empty() {
        return Ok(labels);
    }
    let simulation =
        engine.prepare_with(scene, &mut Control::default().with_cancel(cancel.clone()))?;
    for slice in 0..z {
        cancel.check()?;
        let line = |column: usize| {
            let [at_x, _, at_z] = grid.centre((slice, 0, column));
            Ray::new(0, [single(at_x), single(at_z)], [0.0; 2])
        };
        let rays: Vec<Ray> = (0..x).map(line).collect();
        let mut plane = labels.index_axis_mut(ndarray::Axis(0), slice);
        for most in MOST {
            let mut full = false;
            simulation.crossings(&rays, most, |ray, met| {
                full |= met.len() >= most as usize;
                let mut column = plane.column_mut(ray);
                let places = (0..y).map(|row| grid.centre((slice, row, ray))[1]);
                let along = along(met, places);
                column.iter_mut().zip(along).for_each(|(to, label)| *to = label);
            })?;
            match (full, most == MOST[1]) {
                (false, _) => break,
                (true, false) => {}
                (true, true) => {
                    let found = format!("a line through {most} surfaces or more in slice {slice}");
                    return Err(Error::argument("truth", found, "lines through fewer surfaces"));
                }
            }
        }
    }
    Ok(labels)
}

/// Labels at ascending places of a line, by its crossings in order: of the object listed last of those
/// that are entered and not left.
fn along<'a>(
    met: &'a [SurfaceCrossing],
    places: impl Iterator<Item = f64> + 'a,
) -> impl Iterator<Item = u16> + 'a {
    let (mut next, mut inside) = (0, Vec::new());
    places.map(move |place| {
        while let Some(crossing) = met.get(next).filter(|met| f64::from(met.y) <= place) {
            if crossing.entering {
                inside.push(crossing.object);
            } else if let Some(at) = inside.iter().rposition(|object| *object == crossing.object) {
                inside.remove(at);
            }
            next += 1;
        }
        // `truth` refuses more objects than labels count.
        inside.iter().max().map_or(0, |object| u16::try_from(*object + 1).unwrap_or(u16::MAX))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_along_a_line_are_of_the_object_listed_last() {
        let at = |y: f32, object: u32, entering: bool| {
            let normal = [0.0, 1.0, 0.0];
            let entering = u32::from(entering);
            SurfaceCrossing::from(&beamlet_interface::SurfaceCrossing {
                y,
                object,
                entering,
                normal,
            })
        };
        // Object 0 holds 1, and 2 begins where 0 ends, found before that.
        let met = [
            at(1.0, 0, true),
            at(2.0, 1, true),
            at(3.0, 1, false),
            at(4.0, 2, true),
            at(4.0, 0, false),
            at(5.0, 2, false),
        ];
        let places = [0.5, 1.5, 2.5, 3.5, 4.5, 5.5];
        let found: Vec<u16> = along(&met, places.into_iter()).collect();
        assert_eq!(found, [0, 1, 2, 1, 3, 0]);
    }
}
