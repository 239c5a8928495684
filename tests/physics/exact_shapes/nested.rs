//! Shapes in shapes and in meshes, on them and across them, against what lies inside along every
//! ray in f64.

use super::rays::{beside, error_among, line, moved};
use super::solids::{Kind, Solid, cylinder, sphere};
use super::{direction, ray_through, scene};
use crate::assemblies::Bench;
use crate::reference::surfaces::Random;
use crate::reference::vector::{Vector, add, length, scaled};
use crate::support::{CARBON, WATER, amount, backends};
use beamlet::internals::trace::Ray;
use beamlet::scene::{Scene, Transport};
use beamlet::{Backend, SurfaceCrossing, geometry};

/// An interface on a ray: y, and the object before and behind it.
#[derive(Debug)]
pub(super) struct Interface {
    y: f64,
    pub(super) media: [Option<usize>; 2],
    /// Normal of the surface that was crossed.
    pub(super) normal: Vector,
}

/// Interfaces of a ray: between any two surfaces the object that is listed last of those around the
/// middle is there. Layers thinner than `least` are left out.
pub(super) fn interfaces(solids: &[Solid], ray: &Ray, least: f64) -> Vec<Interface> {
    let [o, d] = line(ray, [0.0; 2]);
    let mut hits: Vec<_> = solids.iter().flat_map(|solid| solid.hits(o, d)).collect();
    hits.sort_by(|a, b| a.t.total_cmp(&b.t));
    let mut all: Vec<Interface> = Vec::new();
    let mut before = None;
    for (k, hit) in hits.iter().enumerate() {
        let next = hits.get(k + 1).map_or(hit.t + 1.0, |next| next.t);
        let middle = add(o, scaled(d, hit.t.midpoint(next)));
        let medium = solids.iter().rposition(|solid| solid.distance(middle) < 0.0);
        if medium != before {
            all.push(Interface { y: hit.t, media: [before, medium], normal: hit.normal });
        }
        before = medium;
    }
    thick(all, least)
}

/// Without layers thinner than `least`. Surfaces in a later object bound none.
fn thick(all: Vec<Interface>, least: f64) -> Vec<Interface> {
    let mut found: Vec<Interface> = Vec::new();
    let mut before = None;
    let mut ends = all.iter().skip(1).map(|it| it.y).collect::<Vec<f64>>().into_iter();
    for it in all {
        let thick = ends.next().is_none_or(|end| end - it.y >= least);
        if thick && it.media[1] != before {
            let media = [before, it.media[1]];
            before = it.media[1];
            found.push(Interface { media, ..it });
        }
    }
    found
}

/// Way of a ray through every solid where no later one covers it.
pub(super) fn ways(solids: &[Solid], ray: &Ray) -> Vec<f64> {
    let mut ways = vec![0.0; solids.len()];
    let stretch = length(line(ray, [0.0; 2])[1]);
    for pair in interfaces(solids, ray, 0.0).windows(2) {
        if let Some(medium) = pair[0].media[1] {
            ways[medium] += (pair[1].y - pair[0].y) * stretch;
        }
    }
    ways
}

/// Interfaces of a list of crossings.
pub(super) fn listed(met: &[SurfaceCrossing], objects: usize, least: f64) -> Vec<Interface> {
    let mut depth = vec![0; objects];
    let mut all: Vec<Interface> = Vec::new();
    let mut before = None;
    for it in met {
        depth[it.object as usize] += if it.entering { 1 } else { -1 };
        let medium = depth.iter().rposition(|count| *count > 0);
        if medium != before {
            let normal = it.normal.map(f64::from);
            all.push(Interface { y: it.y.into(), media: [before, medium], normal });
        }
        before = medium;
    }
    assert!(before.is_none() && depth.iter().all(|count| *count == 0), "{met:?}");
    thick(all, least)
}

fn scene_of(solids: &[Solid], transport: Transport) -> Scene {
    let object = |(number, solid): (usize, &Solid)| solid.object(&format!("{number}"), "");
    let constants: Vec<[f64; 2]> =
        (0..solids.len()).map(|k| if k % 2 == 0 { CARBON } else { WATER }).collect();
    scene(solids.iter().enumerate().map(object).collect(), &constants, transport)
}

/// The largest error of the ways of a ray, m, if rays beside it have equal ways (else 0), where surfaces err
/// by `error`, m. `Err` where the ways differ by more than a ray beside by twice this error may make.
pub(super) fn compared(
    solids: &[Solid],
    ray: &Ray,
    got: &[f64],
    crossings: u32,
    error: f64,
) -> Result<f64, String> {
    let near = beside(2.0 * error).map(|by| ways(solids, &moved(ray, by)));
    let room = f64::from(crossings.max(2)) * error;
    let mut worst = 0.0_f64;
    for k in 0..solids.len() {
        let Some(found) = error_among(&near.each_ref().map(|it| it[k]), got[k], room, error) else {
            return Err(format!("{ray:?}: {got:?} for {:?} in {solids:?}", near[0]));
        };
        worst = worst.max(found);
    }
    Ok(worst)
}

/// Compares ways through objects; `error`: of surfaces, m. Gives how many rays differ by more than
/// a ray beside by twice the error does.
fn differing(
    bench: &Bench,
    backend: Backend,
    solids: &[Solid],
    rays: &[Ray],
    error: f64,
) -> Vec<String> {
    let scene = scene_of(solids, Transport::FirstOrder);
    let traced = bench.traced(backend, &scene, rays, solids.len());
    let found = rays
        .iter()
        .zip(traced)
        .filter_map(|(ray, it)| compared(solids, ray, &it.paths, it.result.crossings, error).err());
    found.map(|found| format!("{backend}: {found}")).collect()
}

fn rays_at(reach: f64, count: usize, random: &mut Random) -> Vec<Ray> {
    let one = |_| {
        let at = scaled(direction(random), reach * random.next());
        ray_through(at, 0, 0.0, random)
    };
    (0..count).map(one).collect()
}

const TUBE: Kind = Kind::Tube { outer: 1.3e-3, inner: 0.8e-3, half: 1e-3 };

/// Solids in one scene. Surfaces are off by 1 nm where they are exact, 1e-8 m (the facets' own error) where they are
/// cut; `error`, m, is twice that and more.
struct Assembly {
    name: &'static str,
    solids: Vec<Solid>,
    error: f64,
}

fn exact<const N: usize>(name: &'static str, solids: [Solid; N]) -> Assembly {
    Assembly { name, solids: solids.to_vec(), error: 2e-9 }
}

fn cut<const N: usize>(name: &'static str, solids: [Solid; N], error: f64) -> Assembly {
    Assembly { name, solids: solids.to_vec(), error }
}

fn tilted(kind: Kind) -> Solid {
    Solid::new(kind).turned([1.0, 0.4, -0.2], 0.5)
}

fn at(kind: Kind, position: Vector) -> Solid {
    Solid::new(kind).at(position)
}

/// A solid at a place of the frame of tilted ones.
fn along(kind: Kind, own: Vector) -> Solid {
    tilted(kind).at(tilted(kind).world(own))
}

fn assemblies() -> impl Iterator<Item = Assembly> {
    nested_shapes().into_iter().chain(tubes()).chain(crossing_shapes())
}

/// Shapes in shapes, and one that a later one covers.
fn nested_shapes() -> Vec<Assembly> {
    let block = Kind::Box([3e-3, 3.4e-3, 2.8e-3]);
    vec![
        exact(
            "sphere in a cylinder in a box",
            [
                tilted(block),
                tilted(cylinder(1.1e-3, 2.2e-3)),
                at(sphere(0.4e-3), [0.1e-3, 0.2e-3, -0.2e-3]),
            ],
        ),
        exact(
            "box in a sphere",
            [Solid::new(sphere(2e-3)), tilted(Kind::Box([1e-3, 1.2e-3, 0.8e-3]))],
        ),
        exact(
            "coated fibre",
            [
                tilted(cylinder(60e-6, 3e-3)).at([1e-3, 0.0, 0.0]),
                tilted(cylinder(50e-6, 2.9e-3)).at([1e-3, 0.0, 0.0]),
            ],
        ),
        exact(
            "sphere covered by a later cylinder",
            [Solid::new(sphere(0.4e-3)), tilted(cylinder(1e-3, 2e-3))],
        ),
    ]
}

/// Tubes, with bodies in their bores and walls.
fn tubes() -> Vec<Assembly> {
    vec![
        exact(
            "wire through the bore of a tube, a bead in its wall and one in its mouth",
            [
                tilted(TUBE),
                tilted(cylinder(0.3e-3, 4e-3)),
                along(sphere(0.1e-3), [1.05e-3, 0.0, 0.2e-3]),
                along(sphere(0.2e-3), [0.0, 0.55e-3, 1e-3]),
            ],
        ),
        exact(
            "tube in the bore of a tube in a box",
            [
                tilted(Kind::Box([4e-3, 4e-3, 4e-3])),
                Solid::new(TUBE).turned([1.0, 0.0, 0.0], 0.3),
                Solid::new(Kind::Tube { outer: 0.7e-3, inner: 0.5e-3, half: 1.2e-3 })
                    .turned([1.0, 0.0, 0.0], 0.32),
            ],
        ),
        exact(
            "liquid that fills the bore of a tube",
            [tilted(TUBE), tilted(cylinder(0.8e-3, 1.2e-3))],
        ),
        exact(
            "wire through the wall of a tube",
            [tilted(TUBE), Solid::new(cylinder(0.2e-3, 5e-3)).turned([0.0, 1.0, 0.0], 1.0)],
        ),
    ]
}

/// Shapes that cross or touch each other.
fn crossing_shapes() -> Vec<Assembly> {
    let block = Kind::Box([3e-3, 3.4e-3, 2.8e-3]);
    vec![
        cut(
            "sphere half in a box",
            [Solid::new(block), at(sphere(0.5e-3), [1.5e-3, 0.1e-3, 0.0])],
            1e-7,
        ),
        cut("cylinder through a box", [Solid::new(block), tilted(cylinder(0.3e-3, 6e-3))], 4e-8),
        cut(
            "cylinder that stands on a box",
            [Solid::new(block), at(cylinder(0.6e-3, 1e-3), [0.2e-3, 0.1e-3, 1.9e-3])],
            4e-8,
        ),
        exact(
            "sphere through a cylinder",
            [tilted(cylinder(30e-6, 200e-6)), at(sphere(40e-6), [30e-6, 10e-6, 0.0])],
        ),
        exact(
            "cylinder covered by a later sphere, and a bead across its side",
            [
                tilted(cylinder(4e-6, 8e-6)),
                Solid::new(sphere(8e-6)),
                at(sphere(2e-6), [1e-6, 2.3e-6, -3.5e-6]),
            ],
        ),
        exact(
            "coated fibre with ends in one plane",
            [Solid::new(cylinder(60e-6, 1e-3)), Solid::new(cylinder(50e-6, 1e-3))],
        ),
    ]
}

#[test]
fn nested_covered_and_cut_shapes_hold_the_light_of_the_later_one() {
    let bench = Bench::new();
    for Assembly { name, solids, error } in assemblies() {
        let sample = geometry::load(&scene_of(&solids, Transport::FirstOrder)).expect("a sample");
        let warned = sample.objects.iter().any(|it| !it.warnings.is_empty());
        let covered = name.contains("covered");
        assert_eq!(warned, error > 2e-9 || covered, "{name}: {:?}", sample.objects);
        for backend in backends() {
            let count = amount(1000, 4000) / if backend == Backend::Bvh { 1 } else { 10 };
            let reach =
                solids.iter().map(|it| it.reach() + length(it.position)).fold(0.0, f64::max);
            let rays = rays_at(reach.min(2e-3), count, &mut Random::new(61));
            let wrong = differing(&bench, backend, &solids, &rays, error);
            println!("measured {backend}, {name}: {} of {count} differ", wrong.len());
            assert!(wrong.is_empty(), "{name}: {} differ: {}", wrong.len(), wrong[0]);
        }
    }
    bench.end();
}

/// Interfaces whose media, places or normals are not those of f64, nor of a ray a hair beside.
pub(super) fn are_listed(solids: &[Solid], ray: &Ray, met: &[SurfaceCrossing], error: f64) -> bool {
    let least = 3.0 * error;
    let got = listed(met, solids.len(), least);
    // A layer about as thin as that may be listed or not: both surfaces err by `error` over the cosine of
    // incidence along the ray.
    [1.0, 0.8, 1.25, 0.5, 2.0]
        .into_iter()
        .any(|share| are_those(solids, ray, &got, share * least, error))
}

fn are_those(solids: &[Solid], ray: &Ray, got: &[Interface], least: f64, error: f64) -> bool {
    beside(4.0 * error).into_iter().any(|by| {
        let want = interfaces(solids, &moved(ray, by), least);
        want.len() == got.len()
            && want.iter().zip(got).all(|(want, got)| {
                // Facets that are off by e stand sqrt(8 e / r) apart and lean by half of that.
                let lean = 0.05;
                let along: f64 = (0..3).map(|k| want.normal[k] * got.normal[k]).sum();
                let d = line(ray, [0.0; 2])[1];
                let cosine: f64 = (0..3).map(|k| want.normal[k] * d[k]).sum();
                let room = 6.0 * error / cosine.abs().max(1e-3);
                want.media == got.media && along.abs() > 1.0 - lean && (want.y - got.y).abs() < room
            })
    })
}
