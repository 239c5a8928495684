//! Scenes of thin parts, drawn from a seed, with the same bodies as facets in f64.

use super::super::case::{Case, Place};
use super::super::draws::Draws;
use super::super::runs::folder;
use super::exact::{Part, exact, scaled_shape};
use super::makers::{self, Sizes, extent, pose, turned};
use beamlet::scene::{
    Beam, Detector, MaskBody, MaskSpec, MaterialSpec, Mesh as SceneMesh, Object, RotationAxis,
    Scene, Source, SpectrumOrigin, SpectrumSpec, Transport,
};
use beamlet_reference::panels::{self, Sheet};
use beamlet_reference::silhouettes::together;
use beamlet_reference::surfaces::{Body, Mesh, body, cuboid};
use beamlet_reference::vector::Vector;
use std::f64::consts::PI;
use std::fmt::Write;

/// Energies of scenes with a spectrum, keV, and their weights.
pub(crate) const ENERGIES: [(f64, f64); 2] = [(25.0, 0.6), (40.0, 0.4)];
/// Constants at the second energy, as parts of those at the first.
const HARDENED: [f64; 2] = [0.35, 0.4];

/// Kinds of parts.
pub(crate) const KINDS: [&str; 14] = [
    "fins",
    "foils",
    "wires",
    "comb",
    "lattice",
    "thread",
    "raised or engraved letters",
    "ridge or pit",
    "tips",
    "corner",
    "many fins",
    "exact wires",
    "exact cones",
    "exact balls and tubes",
];
/// Ways in which a scene has its parts.
pub(crate) const WAYS: [&str; 5] =
    ["one mesh", "one mesh with a block", "objects", "instances", "exact shapes"];

/// A scene and what its truth is computed from.
#[derive(Debug)]
pub(crate) struct Parts {
    pub(crate) kind: &'static str,
    pub(crate) way: &'static str,
    pub(crate) case: Case,
    pub(crate) beam: panels::Beam,
    /// In the frame of the sample, with constants at the first energy.
    pub(crate) bodies: Vec<Body>,
    pub(crate) tolerance: f64,
    /// Set-up in words.
    pub(crate) features: String,
}

/// The scene of a seed.
pub(crate) fn parts(seed: u64) -> Parts {
    let mut draws = Draws::new(seed ^ 0x7061_7274);
    let kind = draws.below(KINDS.len());
    let magnification = draws.log_between(1.05, 8.0);
    let source = draws.log_between(0.25, 1.5);
    let detector = source * magnification;
    let row = draws.log_between(20e-6, 150e-6);
    let pitch = [row * magnification * draws.pick([1.0, 1.0, 0.6, 1.7]), row * magnification];
    let column = pitch[0] / pitch[1];
    let pixels = draws.pick([[2, 4], [3, 3], [4, 2], [2, 6], [3, 4]]);
    let least = 1e-6 / row;
    let thickness = match draws.below(3) {
        0 => [least, 0.1_f64.max(1.5 * least)],
        1 => [least, 0.6],
        _ => [least, 3.0],
    };
    let depth = (1e-3 / row).min(20.0) * draws.log_between(0.2, 1.0);
    let sizes = Sizes { thickness, column, depth };
    let count = count(&mut draws, kind);
    let list: Vec<Part> = (0..count).map(|_| part(&mut draws, kind, sizes)).collect();
    let way = way(&mut draws, kind, &list);
    let room =
        [0.5 * f64::from(pixels[0]) * column, 0.3 * depth.min(5.0), 0.5 * f64::from(pixels[1])];
    let mut drawn = Scattered { row, room, objects: Vec::new(), bodies: Vec::new() };
    drawn.place(&mut draws, list, way);
    let beam = beam(&mut draws, [source, detector], pixels, pitch, row * drawn.deepest());
    let scene = scene(&mut draws, &beam);
    let mut case = Case { scene, places: Vec::new(), roughness: Vec::new() };
    let mut constants = constants(&mut draws, row * depth);
    if case.scene.sampling.transport == Transport::FirstOrder {
        // Steep faces would move light by rows.
        constants[1] = constants[1].min(1e-9);
    }
    let (many, tolerance) = (draws.chance(0.12), draws.pick([1e-4, 1e-4, 1e-4, 3e-4, 3e-4, 1e-5]));
    material(&mut case.scene, constants, many, seed);
    case.scene.sampling.tolerance = Some(tolerance);
    case.scene.sampling.max_rays = 1_000_000;
    case.scene.sampling.audit = 0.0;
    for (object, places) in drawn.objects {
        case.add(object, places);
    }
    let bodies =
        drawn.bodies.into_iter().map(|mesh| body(mesh, constants[0], constants[1])).collect();
    let masks = [case.scene.sample_mask.is_some(), case.scene.detector_mask.is_some()];
    let features = format!(
        "{count} parts, row {:.0} um, {} to {} rows, M {magnification:.2}, spot {:?} um, masks {masks:?}, delta {:.0e}, tol {tolerance:.0e}, {:?}{}",
        row * 1e6,
        (thickness[0] * 1e3).round() / 1e3,
        thickness[1],
        beam.spot.map(|it| (it * 1e6).round()),
        constants[1],
        case.scene.sampling.transport,
        if many { ", spectrum" } else { "" },
    );
    Parts { kind: KINDS[kind], way: WAYS[way], case, beam, bodies, tolerance, features }
}

/// How many parts a scene of a kind has.
fn count(draws: &mut Draws, kind: usize) -> usize {
    match kind {
        3..=7 | 9 => 1 + draws.below(2),
        10 => draws.log_between(5.0, 61.0) as usize,
        _ => 1 + draws.below(5),
    }
}

fn way(draws: &mut Draws, kind: usize, list: &[Part]) -> usize {
    if kind >= 11 {
        return if draws.chance(0.3) && list[0].shells.len() == 1 { 3 } else { 4 };
    }
    match draws.below(4) {
        3 if list[0].shells.len() > 1 => 0,
        other => other,
    }
}

fn part(draws: &mut Draws, kind: usize, sizes: Sizes) -> Part {
    let mesh = |shells: Vec<Mesh>| Part { shells, shape: None };
    match kind {
        0 | 10 => mesh(vec![makers::fin(draws, sizes)]),
        1 => {
            let long = Sizes { column: 3.0 * sizes.column, ..sizes };
            mesh(vec![makers::fin(draws, long)])
        }
        2 => mesh(vec![makers::wire(draws, sizes)]),
        3 => mesh(makers::comb(draws, sizes)),
        4 => mesh(makers::lattice(draws, sizes)),
        5 => mesh(vec![makers::thread(draws, sizes)]),
        6 => mesh(vec![makers::relief(draws, sizes, true)]),
        7 => mesh(vec![makers::relief(draws, sizes, false)]),
        8 => mesh(vec![makers::tip(draws, sizes)]),
        9 => mesh(vec![makers::corner(draws, sizes)]),
        _ => exact(draws, kind, sizes),
    }
}

/// Objects and bodies where they are placed.
struct Scattered {
    row: f64,
    /// Half of the space about the centre, rows.
    room: Vector,
    objects: Vec<(Object, Vec<Place>)>,
    /// In m.
    bodies: Vec<Mesh>,
}

impl Scattered {
    fn add(&mut self, geometry: impl Into<beamlet::scene::ShapeOrMesh>) -> &mut Object {
        let name = format!("part {}", self.objects.len());
        self.objects.push((Object::new(name, geometry, "matter"), Vec::new()));
        &mut self.objects.last_mut().expect("an object").0
    }

    fn anywhere(&self, draws: &mut Draws) -> Vector {
        self.room.map(|half| half * draws.between(-1.0, 1.0))
    }

    fn place(&mut self, draws: &mut Draws, list: Vec<Part>, way: usize) {
        let row = self.row;
        if way == 3 {
            return self.instances(draws, list);
        }
        let mut shells = Vec::new();
        for Part { shells: one, shape } in list {
            let (turns, at) = (pose(draws), self.anywhere(draws));
            let placed = |mesh: Mesh| turned(mesh, &turns).moved(at).scaled(row);
            if let Some(shape) = shape {
                self.bodies.extend(one.into_iter().map(placed));
                let object = self.add(scaled_shape(shape, row));
                object.placement.rotate = turns;
                object.placement.position = at.map(|x| x * row);
                continue;
            }
            let one: Vec<Mesh> = one.into_iter().map(|mesh| placed(mesh).rounded()).collect();
            if way == 2 {
                let mesh = one_mesh(one.iter());
                self.add(mesh);
            }
            shells.extend(one);
        }
        if way == 1 {
            let side = draws.pick([-1.0, 1.0]);
            let size = [3.0, draws.between(1.0, 5.0), draws.between(3.0, 8.0)];
            let middle = side * (1.5 + self.room[0] * draws.between(-0.5, 0.9));
            shells.push(
                cuboid(size).moved([middle, 0.0, draws.between(-1.0, 1.0)]).scaled(row).rounded(),
            );
        }
        if way < 2 {
            let mesh = one_mesh(shells.iter());
            self.add(mesh);
        }
        self.bodies.extend(shells);
    }

    /// The first part in all places.
    fn instances(&mut self, draws: &mut Draws, list: Vec<Part>) {
        let (row, count) = (self.row, list.len() + 1);
        let part = list.into_iter().next().expect("a part");
        let mesh = part.shells.into_iter().next().expect("a shell");
        match part.shape {
            Some(shape) => self.add(scaled_shape(shape, row)),
            None => {
                let scaled = mesh.clone().scaled(row);
                let mesh = one_mesh([&scaled].into_iter());
                self.add(mesh)
            }
        };
        for _ in 0..count {
            let (axis, angle) =
                (draws.direction(), if draws.chance(0.3) { 0.0 } else { draws.between(-PI, PI) });
            let (at, scale) = (self.anywhere(draws), draws.between(0.5, 1.0));
            let (sin, cos) = (0.5 * angle).sin_cos();
            let rotation = [cos, sin * axis[0], sin * axis[1], sin * axis[2]];
            let position = at.map(|x| x * row);
            self.objects[0].1.push(Place { rotation, position, scale });
            self.bodies.push(mesh.clone().scaled(scale * row).turned(axis, angle).moved(position));
        }
    }

    /// Farthest from the rotation centre, rows.
    fn deepest(&self) -> f64 {
        let far = extent(std::slice::from_ref(&together(self.bodies.iter().cloned())));
        far.iter().map(|it| it * it).sum::<f64>().sqrt() / self.row
    }
}

/// Shells as one mesh of a scene.
fn one_mesh<'a>(shells: impl Iterator<Item = &'a Mesh>) -> SceneMesh {
    let Mesh { vertices, triangles } = together(shells.cloned());
    SceneMesh::Arrays { vertices, triangles }
}

/// Set-up of the reference; the sample extends `deepest` (m) from the rotation centre.
fn beam(
    draws: &mut Draws,
    [source, detector]: [f64; 2],
    pixels: [u32; 2],
    pitch: [f64; 2],
    deepest: f64,
) -> panels::Beam {
    let [with_sample_mask, with_detector_mask] =
        draws.pick([[false; 2], [true, false], [false, true], [true; 2], [true; 2]]);
    let ended = draws.chance(0.25);
    let mut sheet = |distance: f64| {
        let open = [draws.between(0.15, 0.7), if ended { draws.between(0.3, 0.8) } else { 2.0 }];
        Sheet {
            distance,
            open,
            leak: if draws.chance(0.2) { draws.between(0.0, 0.3) } else { 0.0 },
        }
    };
    let sample_mask = with_sample_mask.then(|| sheet(source - 1.2 * deepest - 1e-3));
    let detector_mask = with_detector_mask.then(|| sheet(detector));
    // The image of the spot is within a pixel.
    let widest = |axis: usize| 0.5 * pitch[axis] / (detector / source - 1.0);
    let mut spot = [0, 1].map(|axis| {
        if draws.chance(0.5) { 0.0 } else { draws.log_between(1e-6, 40e-6).min(widest(axis)) }
    });
    if ended {
        spot[1] = 0.0;
    }
    let mut offsets = vec![0.0];
    if let Some(sheet) = sample_mask {
        let period = pitch[0] * sheet.distance / detector;
        offsets = (0..1 + draws.below(3)).map(|_| period * draws.between(-0.4, 0.4)).collect();
    }
    panels::Beam { source, detector, spot, pixels, pitch, sample_mask, detector_mask, offsets }
}

fn scene(draws: &mut Draws, beam: &panels::Beam) -> Scene {
    let source = Source::new(beam.source, beam.spot, Beam::Energy(ENERGIES[0].0));
    let mut scene = Scene::new(source, Detector::new(beam.detector, beam.pixels, beam.pitch));
    let mask = |sheet: &Sheet| {
        let [x, z] = beam.pitch.map(|pitch| pitch * sheet.distance / beam.detector);
        let spec = MaskSpec::new(
            sheet.distance,
            x,
            x * sheet.open[0],
            MaskBody::Sheet { transmission: sheet.leak },
        );
        if sheet.open[1] >= 1.0 {
            return spec;
        }
        spec.with_heights(beamlet::scene::ApertureShape::Rectangle, z * sheet.open[1], z)
    };
    scene.sample_mask = beam.sample_mask.as_ref().map(mask);
    scene.detector_mask = beam.detector_mask.as_ref().map(mask);
    scene.scan.mask_offsets.clone_from(&beam.offsets);
    if draws.chance(0.3) {
        scene.scan.angles = vec![draws.between(-PI, PI), draws.between(-0.1, 0.1)];
    }
    if draws.chance(0.2) {
        scene.scan.axis =
            RotationAxis::new([0.0; 3], draws.between(-0.05, 0.05), draws.between(-0.05, 0.05));
    }
    scene.sampling.transport =
        draws.pick([Transport::Auto, Transport::Auto, Transport::FirstOrder, Transport::Exact]);
    scene
}

/// mu and delta of the parts, which let through something of a body of this depth (m).
fn constants(draws: &mut Draws, depth: f64) -> [f64; 2] {
    let mu = draws.log_between(0.3, 8.0) / depth;
    [mu.min(5e5), if draws.chance(0.75) { 1e-12 } else { draws.log_between(1e-9, 3e-7) }]
}

/// Gives a scene its matter, for one energy or those of a spectrum.
fn material(scene: &mut Scene, [mu, delta]: [f64; 2], many: bool, seed: u64) {
    let spec = if many {
        let (lines, table) = [1.0, 0.0].into_iter().zip(ENERGIES).fold(
            (String::from("energy_keV,weight\n"), String::from("energy_keV,mu_per_cm,delta\n")),
            |(mut lines, mut table), (first, (energy, weight))| {
                let part = HARDENED.map(|it| if first == 1.0 { 1.0 } else { it });
                let _ = writeln!(lines, "{energy},{weight}");
                let _ = writeln!(table, "{energy},{:e},{:e}", 1e-2 * mu * part[0], delta * part[1]);
                (lines, table)
            },
        );
        let [path, constants] =
            ["lines", "matter"].map(|name| folder().join(format!("parts-{seed}-{name}.csv")));
        std::fs::write(&path, lines).expect("a spectrum");
        std::fs::write(&constants, table).expect("constants");
        scene.source.beam =
            Beam::Spectrum(SpectrumSpec::new(SpectrumOrigin::File { path }).with_nodes(2));
        MaterialSpec::Table { path: constants }
    } else {
        MaterialSpec::Constants { mu, delta }
    };
    scene.materials.insert("matter".into(), spec);
}

impl Parts {
    /// Bodies at an energy in the frame of a view.
    pub(crate) fn seen(&self, angle: f64, energy: usize) -> Vec<Body> {
        let RotationAxis { tilt_x, tilt_y, .. } = self.case.scene.scan.axis;
        let part = if energy == 0 { [1.0; 2] } else { HARDENED };
        let seen = |it: &Body| Body {
            mesh: it
                .mesh
                .clone()
                .turned([0.0, 0.0, 1.0], -angle)
                .turned([0.0, 1.0, 0.0], tilt_y)
                .turned([1.0, 0.0, 0.0], tilt_x),
            mu: it.mu * part[0],
            delta: it.delta * part[1],
        };
        self.bodies.iter().map(seen).collect()
    }

    /// Weights of the energies.
    pub(crate) fn weights(&self) -> Vec<f64> {
        let single = self.case.scene.source.beam.single_energy().is_some();
        if single { vec![1.0] } else { ENERGIES.map(|it| it.1).to_vec() }
    }
}
