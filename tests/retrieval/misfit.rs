//! The flag of misfits against scenes whose transmission without refraction, and whose silhouettes, are known.

use crate::reference::draws::Draws;
use crate::stacks::images_of;
use crate::support::{Checked, engine, free_gaussian};
use beamlet::retrieve::{Images, Weights, flags};
use beamlet::scene::Scene;
use beamlet::{Backend, Ray, uncovered};
use ndarray::{Array2, Array3, Axis};
use std::fmt::Write;

const ROWS: u32 = 32;
const COLUMNS: u32 = 64;
/// Name, attenuation in 1/m and decrement at 30 keV.
const MATERIALS: [(&str, f64, f64); 4] = [
    ("carbon", 51.1, 4.61e-7),
    ("poly", 25.0, 2.5e-7),
    ("light metal", 304.0, 5.4e-7),
    ("metal", 6400.0, 1.8e-6),
];

/// Objects of the scenes: a rod, a ball, a tilted box, wires; an object is its material, shape and place.
fn objects() -> [String; 4] {
    let object = |material: &str, shape: &str, more: &str| {
        format!(
            "[[object]]\nname = \"of {material}\"\nmaterial = \"{material}\"\nshape = {{ {shape} }}\n{more}\n"
        )
    };
    let rod = |radius: &str| format!("cylinder = {{ radius = \"{radius}\", height = \"20 mm\" }}");
    let wire = |material: &str, radius: &str, angle: i32, x: &str| {
        let more = format!(
            "rotate = [{{ axis = [0, 1, 0], angle = \"{angle} deg\" }}]\nposition = [\"{x}\", \"0 mm\", \"0 mm\"]"
        );
        object(material, &rod(radius), &more)
    };
    [
        object("carbon", &rod("2.4 mm"), ""),
        object("poly", "sphere = { radius = \"1.3 mm\" }", ""),
        object(
            "light metal",
            "box = { size = [\"2.2 mm\", \"2 mm\", \"1.8 mm\"] }",
            "rotate = [{ axis = [0, 1, 0], angle = \"25 deg\" }, { axis = [0, 0, 1], angle = \"20 deg\" }]",
        ),
        wire("poly", "300 um", 3, "-1.8 mm")
            + &wire("light metal", "150 um", -4, "0.1 mm")
            + &wire("metal", "40 um", 11, "1.7 mm"),
    ]
}

/// A scene; without refraction its stacks hold the transmission alone.
fn scene(objects: &str, refraction: bool) -> Scene {
    let mut text = format!(
        "{}\n[detector]\ndistance = \"1.8 m\"\npixels = [{COLUMNS}, {ROWS}]\npitch = \"150 um\"\n\
         [scan]\nmask_offsets = {{ from = \"-25 um\", to = \"25 um\", count = 11 }}\n\
         [sampling]\ntolerance = 3e-4\n",
        include_str!("../support/masks.toml"),
    );
    for (name, mu, delta) in MATERIALS {
        let delta = if refraction { delta } else { 1e-14 };
        writeln!(text, "[materials.\"{name}\"]\nmu = \"{mu} /m\"\ndelta = {delta:e}").unwrap();
    }
    Scene::from_toml(&(text + objects), ".").unwrap()
}

/// Pixels that a silhouette crosses: rays through them meet surfaces unequally often.
fn silhouettes(engine: &Checked, scene: &Scene) -> Array2<bool> {
    const FINE: u32 = 8;
    let simulation = engine.prepare(scene).unwrap();
    let [width, height] = [COLUMNS * FINE, ROWS * FINE];
    // From the spot through a point of the detector: where it passes the plane of the axis.
    let at = |i: u32, count: u32| {
        ((f64::from(i) + 0.5) / f64::from(FINE) - 0.5 * f64::from(count)) * 150e-6
    };
    let rays: Vec<Ray> = (0..width * height)
        .map(|i| [at(i % width, COLUMNS), -at(i / width, ROWS)])
        .map(|[x, z]| {
            let [dx, dz] = [x / 1.8, z / 1.8];
            Ray::new(0, [(dx * 1.21) as f32, (dz * 1.21) as f32], [dx as f32, dz as f32])
        })
        .collect();
    let mut met = vec![0; rays.len()];
    simulation.crossings(&rays, 16, |ray, found| met[ray] = uncovered(found).len()).unwrap();
    // With the penumbra of the spot, which reaches an eighth of a pixel (three standard deviations).
    let [width, height] = [width as usize, height as usize];
    Array2::from_shape_fn((ROWS as usize, COLUMNS as usize), |(row, column)| {
        let reach = |at: usize, end: usize| {
            let first = at * FINE as usize;
            first.saturating_sub(1)..(first + FINE as usize + 1).min(end)
        };
        let mut of = reach(row, height)
            .flat_map(|row| reach(column, width).map(move |column| row * width + column))
            .map(|ray| met[ray]);
        let first = of.next();
        of.any(|count| Some(count) != first)
    })
}

/// Images of a flat and a sample; `gain`: of counts.
fn retrieved(
    engine: &Checked,
    scene: &Scene,
    gain: Option<f64>,
    [flat, sample]: [&Array3<f32>; 2],
) -> Images {
    let mut options = free_gaussian();
    if let Some(gain) = gain {
        options = options.with_weights(Weights::Poisson).with_gain(gain);
    }
    images_of(engine, scene, &options, [flat.view(), sample.view()])
}

/// Noise-free stacks of a scene with what is true of it.
struct Known {
    scene: Scene,
    stacks: [Array3<f32>; 2],
    transmission: Array2<f32>,
    crossed: Array2<bool>,
}

impl Known {
    fn of(engine: &Checked, objects: &str) -> Self {
        let stacks = |scene: &Scene| {
            let stacks = engine.simulate(scene).unwrap();
            [stacks.flat, stacks.sample.index_axis(Axis(0), 0).to_owned()]
        };
        let plain = scene(objects, false);
        let images = retrieved(engine, &plain, None, stacks(&plain).each_ref());
        let scene = scene(objects, true);
        Self {
            stacks: stacks(&scene),
            scene,
            transmission: images.get("transmission").unwrap().clone(),
            crossed: silhouettes(engine, &plain),
        }
    }

    /// Images without noise, or of counts of an open pixel with `photons`.
    fn images(&self, engine: &Checked, photons: Option<f64>, draws: &mut Draws) -> Images {
        let Some(photons) = photons else {
            return retrieved(engine, &self.scene, None, self.stacks.each_ref());
        };
        let counts = self
            .stacks
            .each_ref()
            .map(|clean| clean.mapv(|light| draws.poisson(f64::from(light) * photons) as f32));
        retrieved(engine, &self.scene, Some(1.0), counts.each_ref())
    }
}

/// Pixels that are flagged, of the pixels that no silhouette crosses, and of the crossed pixels whose transmission is off
/// by more than 5 sigma, or 0.025 without noise.
#[test]
fn silhouettes_with_a_wrong_transmission_are_flagged_and_clean_pixels_are_not() {
    let engine = engine(Backend::Bvh);
    let mut draws = Draws(17);
    let all = objects().map(|objects| Known::of(&engine, &objects));
    for (photons, least) in [(Some(2e4), 0.5), (Some(1e6), 0.65), (None, 0.9)] {
        let (mut clean, mut off) = ([0_u32; 2], [0_u32; 2]);
        for known in &all {
            let images = known.images(&engine, photons, &mut draws);
            let sigmas = images.get("transmission_sigma");
            let [bits, got] = ["flags", "transmission"].map(|name| images.get(name).unwrap());
            for (at, crossed) in known.crossed.indexed_iter() {
                let error = (got[at] - known.transmission[at]).abs();
                let is_off = error > sigmas.map_or(0.025, |sigmas| 5.0 * sigmas[at]);
                let counts = match (*crossed, is_off) {
                    (false, _) => &mut clean,
                    (true, true) => &mut off,
                    _ => continue,
                };
                counts[0] += u32::from(bits[at] as u32 & flags::MISFIT != 0);
                counts[1] += 1;
            }
        }
        println!("{photons:?} photons: clean flagged {clean:?}, off flagged {off:?}");
        assert!(200 * clean[0] <= clean[1], "{photons:?}: {clean:?}");
        assert!(f64::from(off[0]) >= least * f64::from(off[1]), "{photons:?}: {off:?}");
    }
}
