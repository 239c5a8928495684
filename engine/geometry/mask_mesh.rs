//! Masks as meshes: bars as closed boxes, or prisms where walls are slanted, a frame around them, a substrate behind
//! them.

use super::NamedMesh;
use beamlet_core::units::Dimension::Length;
use beamlet_core::{Error, Result, numbers, setters};
use beamlet_model::optics::{Mask, Optics};
use beamlet_model::scene::Scene;

/// Most bars of a mesh: far beyond any mask.
const MOST_BARS: f64 = 1e6;

/// One of the two masks of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum MaskPlace {
    /// The mask before the sample.
    Sample,
    /// The mask before the detector.
    Detector,
}

impl MaskPlace {
    /// Its key in the scene.
    #[must_use]
    pub const fn key(self) -> &'static str {
        match self {
            Self::Sample => "sample_mask",
            Self::Detector => "detector_mask",
        }
    }
}

/// How a mask is made a mesh.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
pub struct MaskMeshOptions {
    /// Least extent of apertures and bars, x and z, m; `None`: all light of the focal spot on its way to
    /// the detector, at every mask offset.
    pub size: Option<[f64; 2]>,
    /// Width of a frame around the bars, as thick as they are, m; `None`: none.
    pub frame: Option<f64>,
    /// Thickness of a substrate behind the bars, m; `None`: none.
    pub substrate: Option<f64>,
}

impl MaskMeshOptions {
    setters! {
        /// Extent along x and z that the bars cover at least, m.
        with_size(size: impl Into<Option<[f64; 2]>>);
        /// Width of a frame, m.
        with_frame(frame: impl Into<Option<f64>>);
        /// Thickness of a substrate, m.
        with_substrate(substrate: impl Into<Option<f64>>);
    }
}

/// A mask of a scene as meshes: `bars`, closed boxes (prisms where they are tapered) that do not touch one another, and
/// optional `frame` and `substrate`, which touch the bars face to face. x runs across the slits from the optical axis, y
/// along the beam from the centre plane of the bars, z along the slits: the position of an object with
/// these meshes is y = distance of the mask - `source.distance`.
///
/// # Errors
/// [`Error::Scene`] where the scene has no such mask, or one without bars; [`Error::Argument`]
/// for a length that is not above 0, or more than a million bars.
///
/// # Example
///
/// ```no_run
/// use beamlet::geometry::write_meshes;
/// use beamlet::{MaskMeshOptions, MaskPlace, mask_meshes, scene::Scene};
///
/// let scene = Scene::load("scene.toml")?;
/// let options = MaskMeshOptions::default().with_frame(5e-3);
/// let meshes = mask_meshes(&scene, MaskPlace::Sample, &options)?;
/// write_meshes("mask.obj".as_ref(), &meshes, 1e-3)?;
/// # Ok::<(), beamlet::Error>(())
/// ```
pub fn mask_meshes(
    scene: &Scene,
    place: MaskPlace,
    options: &MaskMeshOptions,
) -> Result<Vec<NamedMesh>> {
    let optics = Optics::of(scene);
    let mask = match place {
        MaskPlace::Sample => &optics.sample_mask,
        MaskPlace::Detector => &optics.detector_mask,
    };
    let Some(mask) = mask else {
        return Err(Error::scene(
            place.key(),
            "no such mask",
            format!("a table [{}]", place.key()),
        ));
    };
    if mask.has_heights() {
        let (key, found) = (format!("{}.shape", place.key()), "apertures that end along z");
        return Err(Error::scene(key, found, "slits"));
    }
    if mask.has_layers() {
        let (key, found) = (format!("{}.layers", place.key()), "bars of several layers");
        return Err(Error::scene(key, found, "bars of one material"));
    }
    let Some(thickness) = mask.side_shadow() else {
        let allowed = "bars with a material and a thickness: a sheet has no body";
        return Err(Error::scene(format!("{}.transmission", place.key()), "a sheet", allowed));
    };
    let [frame, substrate] = [("frame", options.frame), ("substrate", options.substrate)];
    for (name, length) in [frame, substrate] {
        above_zero(name, length)?;
    }
    let size = match options.size {
        Some(size) => size,
        None => lit(scene, mask),
    };
    size.into_iter().try_for_each(|side| above_zero("size", Some(side)))?;
    let bars = bars(mask, size[0])?;
    let (half, depth) = (size[1] / 2.0, thickness / 2.0);
    let mut boxes = NamedMesh::new("bars", Vec::new(), Vec::new());
    let mut outer = [bars[0][0], bars[bars.len() - 1][1]];
    for [low, high] in &bars {
        let first = boxes.vertices.len();
        add_box(&mut boxes, [*low, -depth, -half], [*high, depth, half]);
        // Walls of slits are slanted, the outer sides of all bars are not.
        for (corner, [x, y, _]) in boxes.vertices[first..].iter_mut().enumerate() {
            let way = if corner & 1 == 0 { 1.0 } else { -1.0 };
            if *x > outer[0] && *x < outer[1] {
                *x += way * mask.wall_slope() * *y;
            }
        }
    }
    let mut meshes = vec![boxes];
    let mut top = half;
    if let Some(width) = options.frame {
        meshes.push(ring([outer, [-half, half]], width, depth));
        outer = [outer[0] - width, outer[1] + width];
        top += width;
    }
    if let Some(thickness) = options.substrate {
        let mut plate = NamedMesh::new("substrate", Vec::new(), Vec::new());
        add_box(&mut plate, [outer[0], depth, -top], [outer[1], depth + thickness, top]);
        meshes.push(plate);
    }
    Ok(meshes)
}

fn above_zero(name: &'static str, length: Option<f64>) -> Result<()> {
    match length {
        Some(length) if !(length.is_finite() && length > 0.0) => {
            Err(Error::argument(name, Length.rounded(length), "a length above 0"))
        }
        _ => Ok(()),
    }
}

/// Extent of the light on its way to the detector in the plane of a mask, x and z, m.
fn lit(scene: &Scene, mask: &Mask) -> [f64; 2] {
    let near = mask.distance() / scene.detector.distance;
    let offsets = scene.scan.mask_offsets.iter().chain(scene.scan.view_offsets.iter().flatten());
    let moved = offsets.fold(0.0_f64, |most, it| most.max(it.abs()));
    let spot = scene.source.spot.fwhm();
    let side = |axis: usize| {
        // Three widths of the spot are seven deviations.
        scene.detector.size()[axis] * near + 6.0 * spot[axis] * (1.0 - near).max(0.0)
    };
    [side(0) + 2.0 * moved + 2.0 * mask.openings(mask.distance()).period[0], side(1)]
}

/// Where bars begin and end, m: one more than the apertures that cover the extent.
fn bars(mask: &Mask, extent: f64) -> Result<Vec<[f64; 2]>> {
    let openings = mask.openings(mask.distance());
    let period = openings.period[0];
    if openings.bar() <= 0.0 {
        let found = Length.rounded(openings.narrowest(0));
        let allowed =
            format!("less than the period, {}: there are no bars", Length.rounded(period));
        return Err(Error::scene(format!("{}.aperture", mask.name()), found, allowed));
    }
    let count = (extent / period).ceil().max(1.0);
    if count > MOST_BARS {
        let allowed = format!("up to {}", Length.rounded(MOST_BARS * period));
        return Err(Error::argument("size", Length.rounded(extent), allowed));
    }
    // The period nearest to the axis, and equal numbers on either side.
    let reach: i32 = numbers::whole((count / 2.0).ceil());
    let nearest = -mask.off_centre(0.0, mask.distance());
    let centre = |number: i32| nearest + f64::from(number) * period;
    // A bar begins where an opening ends; the last of a period ends where the next period opens.
    let bars = |number: i32| {
        let begins = openings.ends().map(move |[_, high]| centre(number) + high);
        let within = openings.ends().skip(1).map(move |[low, _]| centre(number) + low);
        let beyond = openings.ends().take(1).map(move |[low, _]| centre(number + 1) + low);
        begins.zip(within.chain(beyond)).map(|(low, high)| [low, high])
    };
    Ok((-reach - 1..=reach).flat_map(bars).collect())
}

/// Adds a closed box.
fn add_box(mesh: &mut NamedMesh, low: [f64; 3], high: [f64; 3]) {
    let first = numbers::count(mesh.vertices.len());
    let corner =
        |n: usize| [0, 1, 2].map(|axis| if n >> axis & 1 == 0 { low[axis] } else { high[axis] });
    mesh.vertices.extend((0..8).map(corner));
    // Faces seen from outside, by corners whose bits are their sides.
    let faces =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    for [a, b, c, d] in faces {
        mesh.triangles.extend([[a, b, c], [a, c, d]].map(|it| it.map(|corner| first + corner)));
    }
}

/// A frame of this width around a rectangle (x, then z), from -`depth` to `depth` along y.
fn ring([x, z]: [[f64; 2]; 2], width: f64, depth: f64) -> NamedMesh {
    let outer = |[low, high]: [f64; 2]| [low - width, high + width];
    let corners = |[left, right]: [f64; 2], [low, high]: [f64; 2]| {
        [[left, low], [right, low], [right, high], [left, high]]
    };
    let mut mesh = NamedMesh::new("frame", Vec::new(), Vec::new());
    // Before and behind, inside and outside: 0 to 3, 4 to 7, 8 to 11, 12 to 15.
    for y in [-depth, depth] {
        let around = corners(x, z).into_iter().chain(corners(outer(x), outer(z)));
        mesh.vertices.extend(around.map(|[x, z]| [x, y, z]));
    }
    for side in 0..4 {
        let next = (side + 1) % 4;
        let [inner, outer] = [0, 4];
        let behind = 8;
        let quads = [
            // Seen from the source, from the detector, from the light, from outside.
            [outer + side, outer + next, inner + next, inner + side],
            [inner + side, inner + next, outer + next, outer + side].map(|it| it + behind),
            [inner + side, inner + next, inner + next + behind, inner + side + behind],
            [outer + side + behind, outer + next + behind, outer + next, outer + side],
        ];
        for [a, b, c, d] in quads {
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}
