//! Scenes that differ in kind, on a detector of 24 x 8 pixels.

use crate::reference::silhouettes::{bumpy, cone, together, torus};
use crate::reference::stack::Setup;
use crate::reference::surfaces::{
    Body, Mesh, Random, body, cuboid, cylinder, prism, sphere, wedge,
};
use crate::reference::{masks::Bars, scenes};
use crate::support::{CARBON, WATER};
use beamlet::scene::{
    Anode, Beam, Blur, Filter, MaskBody, Normals, Scene, SpectrumOrigin, SpectrumSpec, Transport,
};

/// Copper at 30 keV: mu in 1/m, delta.
const COPPER: [f64; 2] = [9.7e3, 1.98e-6];
/// Mask offsets of most scenes, m.
const OFFSETS: [f64; 7] = [-25e-6, -15e-6, -8e-6, 0.0, 8e-6, 15e-6, 25e-6];

/// A scene and what is in it.
#[derive(Debug, Clone)]
pub(crate) struct Case {
    pub(crate) name: String,
    pub(crate) scene: Scene,
    pub(crate) setup: Setup,
    pub(crate) bodies: Vec<Body>,
    /// How far light of a silhouette spreads beyond its own place, pixels in x and z.
    pub(crate) margin: [f64; 2],
}

impl Case {
    fn new(name: impl Into<String>, setup: &Setup, bodies: Vec<Body>, offsets: &[f64]) -> Self {
        let scene = scenes::scene(setup, &bodies, offsets);
        Self { name: name.into(), scene, setup: setup.clone(), bodies, margin: [0.12; 2] }
    }

    fn paper(name: impl Into<String>, bodies: Vec<Body>) -> Self {
        Self::new(name, &paper(), bodies, &OFFSETS)
    }

    /// The case with its sample moved, m.
    pub(crate) fn moved(&self, by: [f64; 3]) -> Self {
        let mut case = self.clone();
        let meshes = case.bodies.iter_mut().zip(&mut case.scene.objects);
        for (body, object) in meshes {
            body.mesh = body.mesh.clone().moved(by);
            object.placement.position =
                std::array::from_fn(|axis| object.placement.position[axis] + by[axis]);
        }
        case
    }
}

fn paper() -> Setup {
    Setup::paper([24, 8])
}

fn of([mu, delta]: [f64; 2], mesh: Mesh) -> Body {
    body(mesh.rounded(), mu, delta)
}

fn about_y(mesh: Mesh, degrees: f64) -> Mesh {
    mesh.turned([0.0, 1.0, 0.0], degrees.to_radians())
}

/// Fibres of 5 um in a disc of this radius, m, turned about z.
fn bundle(count: usize, radius: f64, degrees: f64) -> Mesh {
    let mut random = Random::new(5);
    let mut centres: Vec<[f64; 2]> = Vec::new();
    while centres.len() < count {
        let c = [random.between(-radius, radius), random.between(-radius, radius)];
        let apart = |p: &[f64; 2]| (p[0] - c[0]).hypot(p[1] - c[1]) > 5.2e-6;
        if c[0].hypot(c[1]) < radius && centres.iter().all(apart) {
            centres.push(c);
        }
    }
    let fibre = |c: &[f64; 2]| prism(2.5e-6, 2e-3, 16, 0.2).moved([c[0], c[1], 0.0]);
    together(centres.iter().map(fibre)).turned([0.0, 0.0, 1.0], degrees.to_radians())
}

fn silhouettes() -> Vec<Case> {
    let place = |mesh: Mesh| mesh.moved([0.017e-3, 0.2e-3, 0.011e-3]);
    vec![
        Case::paper(
            "cylinder, facets of 60 um",
            vec![of(CARBON, place(cylinder(0.9e-3, 3e-3, 96, 0.3)))],
        ),
        Case::paper(
            "cylinder, facets of 3 um",
            vec![of(CARBON, place(cylinder(0.9e-3, 3e-3, 2048, 0.3)))],
        ),
        Case::paper("ball, facets of 55 um", vec![of(CARBON, place(sphere(0.36e-3, 3)))]),
        Case::paper("ball, facets of 7 um", vec![of(CARBON, place(sphere(0.36e-3, 6)))]),
        Case::paper("bumpy ball, facets of 14 um", vec![of(CARBON, place(bumpy(0.36e-3, 5)))]),
        Case::paper(
            "prism slanting by 10 degrees",
            vec![of(CARBON, place(about_y(cylinder(0.8e-3, 4e-3, 512, 0.3), 10.0)))],
        ),
        Case::paper(
            "prism slanting by 45 degrees",
            vec![of(CARBON, place(about_y(cylinder(0.4e-3, 2e-3, 256, 0.3), 45.0)))],
        ),
        Case::paper(
            "cone and torus",
            vec![
                of(CARBON, cone(0.4e-3, 0.6e-3, 200).moved([-0.6e-3, 0.0, 0.013e-3])),
                of(WATER, torus([0.3e-3, 0.1e-3], [80, 40]).moved([0.5e-3, 0.0, 0.007e-3])),
            ],
        ),
        Case::paper("wedge", vec![of(CARBON, place(wedge(0.9e-3, 0.6, 0.5e-3)))]),
        Case::paper(
            "block along the beam",
            vec![of(CARBON, place(cuboid([0.83e-3, 0.6e-3, 0.41e-3])))],
        ),
    ]
}

fn narrow() -> Vec<Case> {
    let wire = |radius: f64| cylinder(radius, 1.5e-3, 24, 0.3);
    let slit = |x: f64| {
        let plate = |side: f64| {
            let centre = x + side * (2e-6 + 100e-6);
            of(COPPER, cuboid([200e-6, 50e-6, 0.5e-3]).moved([centre, 0.0, 0.013e-3]))
        };
        vec![plate(-1.0), plate(1.0)]
    };
    // The apertures of beamlets stand 100.8 um apart in the plane of the rotation centre.
    let in_aperture = |k: f64, x: f64| (k + 0.5) * 100.83e-6 + x;
    vec![
        Case::paper(
            "wires of 5 um",
            vec![
                of(COPPER, wire(2.5e-6).moved([in_aperture(2.0, 2e-6), 0.0, 0.0])),
                of(COPPER, about_y(wire(2.5e-6), 30.0).moved([-0.5e-3, 0.0, 0.0])),
            ],
        ),
        Case::paper(
            "wire of 8 um across",
            vec![of(COPPER, about_y(wire(4e-6), 90.0).moved([0.0, 0.0, 0.031e-3]))],
        ),
        Case::paper("slit of 4 um", slit(in_aperture(1.0, 3e-6))),
    ]
}

fn fibre_bundles() -> impl Iterator<Item = Case> {
    [0.0, 13.0, 27.0, 45.0, 90.0].into_iter().map(|degrees| {
        let fibres = bundle(300, 0.12e-3, degrees).moved([0.03e-3, 0.0, 0.0]);
        Case::paper(format!("300 fibres at {degrees} degrees"), vec![of(CARBON, fibres)])
    })
}

fn set_ups() -> Vec<Case> {
    let ball = || vec![of(CARBON, bumpy(0.36e-3, 4).moved([0.017e-3, 0.2e-3, 0.011e-3]))];
    let mut bare = paper();
    (bare.sample_mask, bare.detector_mask) = (None, None);
    let mut tracking = paper();
    tracking.detector_mask = None;
    let mut analyser = paper();
    analyser.sample_mask = None;
    let mut point = paper();
    point.spot = [0.0; 2];
    let mut blurred = Case::paper("detector blur of 100 um", ball());
    let sigma = [42e-6, 42e-6];
    blurred.scene.detector.blur = Some(Blur::Gaussian { sigma });
    blurred.margin = [1.0; 2];
    let sheets = paper().with_bars(Bars::Sheet { transmission: 0.0 });
    let uneven = [-31e-6, -9e-6, -2e-6, 0.0, 17e-6];
    vec![
        Case::new("one step", &paper(), ball(), &[8e-6]),
        Case::new("uneven steps", &sheets, ball(), &uneven),
        Case::new("no masks", &bare, ball(), &[0.0]),
        Case::new("sample mask alone", &tracking, ball(), &[0.0]),
        Case::new("detector mask alone", &analyser, ball(), &[0.0]),
        Case::new("point spot", &point, ball(), &OFFSETS),
        blurred,
        spectrum(ball()),
    ]
}

/// Under a tube of 60 kV in four energies.
fn spectrum(bodies: Vec<Body>) -> Case {
    let mut case = Case::paper("spectrum", bodies);
    let origin = SpectrumOrigin::Tube {
        anode: Anode::Tungsten,
        kvp: 60.0,
        anode_angle: 12.0_f64.to_radians(),
        inherent_filters: Vec::new(),
    };
    let filters = vec![Filter::new("Al", 1e-3)];
    let scene = &mut case.scene;
    scene.source.beam =
        Beam::Spectrum(SpectrumSpec::new(origin).with_filters(filters).with_nodes(4));
    for mask in scene.sample_mask.iter_mut().chain(&mut scene.detector_mask) {
        if let MaskBody::Bars { material, .. } = &mut mask.body {
            "gold".clone_into(material);
        }
    }
    scene.objects.iter_mut().for_each(|object| "carbon".clone_into(&mut object.material));
    scene.materials.clear();
    case
}

/// Masks whose bars leak, with their transmission.
fn leaking_bars() -> [(&'static str, Bars); 4] {
    [
        ("gold of 100 um at 60 keV", Bars::Boxes { mu: 8.74e3, thickness: 100e-6 }),
        ("gold of 225 um at 80 keV", Bars::Boxes { mu: 4.3e3, thickness: 225e-6 }),
        ("sheets of 0.3", Bars::Sheet { transmission: 0.3 }),
        ("sheets of 0.96", Bars::Sheet { transmission: 0.96 }),
    ]
}

/// Mask offsets that leave gaps between openings, m.
const GAPS: [f64; 3] = [-33e-6, 0.0, 33e-6];

/// The same case sampled by rays alone: by exact transport, and by smooth normals.
fn by_rays_alone(case: &Case) -> [Case; 2] {
    let [mut exact, mut smooth] = [case.clone(), case.clone()];
    exact.name += ", exact";
    exact.scene.sampling.transport = Transport::Exact;
    smooth.name += ", smooth";
    smooth.scene.objects.iter_mut().for_each(|object| object.normals = Normals::Smooth);
    [exact, smooth]
}

/// A box along the beam whose wall of 5 um lies in no opening of a mask that leaks. Nothing changes along
/// the rows.
pub(crate) fn walls_behind_bars() -> Vec<Case> {
    let wall = cuboid([20e-6, 300e-6, 8e-3]).turned([0.0, 0.0, 1.0], 1_f64.to_radians());
    let bodies = vec![of(COPPER, wall.moved([14e-6, 0.0, 0.0]))];
    let case = |(name, bars): (&str, Bars)| {
        let setup = Setup::paper([8, 1]).with_bars(bars);
        Case::new(format!("wall, {name}"), &setup, bodies.clone(), &GAPS)
    };
    leaking_bars().into_iter().map(case).flat_map(|case| by_rays_alone(&case)).collect()
}

/// A prism of 0.9 um, upright, seen 20 times larger without masks by pixels of 0.5 um at the sample.
pub(crate) fn magnified_prism() -> Case {
    let setup = Setup {
        source_distance: 0.05,
        spot: [0.2e-6; 2],
        source_offset: [0.0; 2],
        detector_distance: 1.0,
        pixels: [12, 1],
        pitch: [10e-6; 2],
        sample_mask: None,
        detector_mask: None,
    };
    let prism = cylinder(0.45e-6, 20e-6, 16, 0.0).moved([0.13e-6, 0.0, 0.0]);
    let mut case = Case::new("prism of 0.9 um", &setup, vec![of([88.4, 1.037e-6], prism)], &[0.0]);
    case.scene.sampling.transport = Transport::Exact;
    case
}

/// Meshes, smooth and exact surfaces and bundles of fibres behind masks that leak.
fn leaks() -> impl Iterator<Item = Case> {
    let place = |mesh: Mesh| mesh.moved([0.017e-3, 0.2e-3, 0.011e-3]);
    leaking_bars().into_iter().flat_map(move |(name, bars)| {
        let setup = Setup::paper([12, 4]).with_bars(bars);
        let of_mesh = |what: &str, mesh: Mesh| {
            Case::new(format!("{what}, {name}"), &setup, vec![of(CARBON, mesh)], &GAPS)
        };
        let ball = of_mesh("ball", place(sphere(0.2e-3, 4)));
        let fibres = of_mesh("300 fibres", bundle(300, 0.12e-3, 27.0).moved([0.03e-3, 0.0, 0.0]));
        by_rays_alone(&ball).into_iter().chain([ball, fibres])
    })
}

/// Small ones, which are moved by parts of a cell.
pub(crate) fn small() -> Vec<Case> {
    let setup = Setup::paper([10, 6]);
    let mut bare = setup.clone();
    (bare.sample_mask, bare.detector_mask) = (None, None);
    let ball = |levels| vec![of(CARBON, bumpy(0.2e-3, levels).moved([0.02e-3, 0.0, 0.01e-3]))];
    let prism = about_y(cylinder(0.3e-3, 2e-3, 256, 0.3), 10.0).moved([0.02e-3, 0.0, 0.0]);
    vec![
        Case::new("ball, facets of 30 um", &setup, ball(3), &OFFSETS),
        Case::new("ball, facets of 7 um", &setup, ball(5), &OFFSETS),
        Case::new("prism slanting by 10 degrees", &setup, vec![of(CARBON, prism)], &OFFSETS),
        Case::new("ball, no masks", &bare, ball(4), &[0.0]),
    ]
}

/// All of them; with `BEAMLET_TRUTH` in the environment those whose name holds it.
pub(crate) fn all() -> Vec<Case> {
    let wanted = std::env::var("BEAMLET_TRUTH").unwrap_or_default();
    silhouettes()
        .into_iter()
        .chain(narrow())
        .chain(fibre_bundles())
        .chain(set_ups())
        .chain(walls_behind_bars())
        .chain(leaks())
        .chain([magnified_prism()])
        .filter(|case| case.name.contains(&wanted))
        .collect()
}
