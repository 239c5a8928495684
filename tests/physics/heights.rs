//! Masks whose apertures end along z: flats against closed forms, cells against random rays and against the
//! reference, which cuts boxes exactly.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "counts of pixels and periods are small"
)]

use crate::reference::apertures::{Ends, Fineness, Sheet, ellipse, pixel};
use crate::reference::closed_form::blurred_overlap;
use crate::reference::rays::Sample;
use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::reference::surfaces::{Body, Mesh, body, extruded, sphere};
use crate::support::cuts::{Cut, bands, no_bit_changes};
use crate::support::{CARBON, Checked, Worst, amount, backends, engine, sample};
use beamlet::Backend;
use beamlet::material::constants_at;
use beamlet::scene::{
    ApertureLattice, ApertureShape, Beam, MaskBody, MaskSpec, Pattern, RandomRays, Rectangle,
    Scene, Scheme, SpectrumOrigin, SpectrumSpec, Substrate,
};
use ndarray::{Array2, Array3};

/// As for slits (tests/physics/flat.rs), for each of two directions.
const SAME_MASKS: f64 = 1e-6;
/// Strips of a round aperture against four hundred.
const STRIPS: f64 = 2e-4;

/// A mask, with lengths along x and z.
#[derive(Debug, Clone, Copy)]
struct Planned {
    distance: f64,
    period: [f64; 2],
    aperture: [f64; 2],
    offset: [f64; 2],
    shape: ApertureShape,
    lattice: ApertureLattice,
    leak: f64,
    /// Rows of 0 and 1 of a pattern that fills a period, from above; none: apertures of the shape.
    rows: &'static [&'static str],
    /// Rectangles of a period: middle along x and z, width and height; none: apertures of the shape.
    listed: &'static [[f64; 4]],
}

impl Planned {
    /// A pattern in place of the apertures.
    fn patterned(self, rows: &'static [&'static str]) -> Self {
        Self { rows, ..self }
    }

    /// A list of rectangles in place of the apertures.
    fn listed(self, listed: &'static [[f64; 4]]) -> Self {
        Self { listed, ..self }
    }

    /// Columns and rows of its pattern, and the size of a pixel.
    fn grid(&self) -> ([usize; 2], [f64; 2]) {
        let count = [self.rows[0].len(), self.rows.len()];
        (count, [0, 1].map(|axis| self.period[axis] / count[axis] as f64))
    }

    fn is_open(&self, row: usize, column: usize) -> bool {
        self.rows[row].as_bytes()[column] == b'1'
    }

    /// Its open pixels, each a box.
    fn open_pixels(&self) -> Vec<Ends> {
        let ([columns, rows], [width, height]) = self.grid();
        let places = (0..rows).flat_map(|row| (0..columns).map(move |column| [row, column]));
        let ends = |[row, column]: [usize; 2]| {
            let left = (column as f64 - 0.5 * columns as f64) * width;
            let top = (0.5 * rows as f64 - row as f64) * height;
            [[left, left + width], [top - height, top]]
        };
        places.filter(|[row, column]| self.is_open(*row, *column)).map(ends).collect()
    }

    /// The same apertures, every second row half a period aside.
    fn hexagonal(self) -> Self {
        Self { lattice: ApertureLattice::Hexagonal, ..self }
    }

    fn spec(&self) -> MaskSpec {
        let body = MaskBody::Sheet { transmission: self.leak };
        let mut spec = MaskSpec::new(self.distance, self.period[0], self.aperture[0], body)
            .with_heights(self.shape, self.aperture[1], self.period[1]);
        [spec.offset, spec.offset_z] = self.offset;
        spec.lattice = self.lattice;
        if !self.listed.is_empty() {
            let of = |&[x, z, width, height]: &[f64; 4]| Rectangle {
                centre: [x, z],
                size: [width, height],
            };
            return spec.with_rectangles(self.listed.iter().map(of).collect(), self.period);
        }
        if self.rows.is_empty() {
            return spec;
        }
        let ([columns, rows], pixel) = self.grid();
        let open =
            Array2::from_shape_fn((rows, columns), |(row, column)| self.is_open(row, column));
        spec.with_pattern(Pattern::new(open), pixel)
    }

    fn sheet(&self, pixels: [u32; 2], strips: u32) -> Sheet {
        let half = self.aperture.map(|width| 0.5 * width);
        let mut boxes = match self.shape {
            _ if !self.rows.is_empty() => self.open_pixels(),
            _ if !self.listed.is_empty() => {
                let about = |middle: f64, size: f64| [-0.5, 0.5].map(|part| middle + part * size);
                let ends = |it: &[f64; 4]| [about(it[0], it[2]), about(it[1], it[3])];
                self.listed.iter().map(ends).collect()
            }
            ApertureShape::Round => ellipse(half, strips),
            _ => vec![half.map(|half| [-half, half])],
        };
        let mut period = self.period;
        if self.lattice == ApertureLattice::Hexagonal {
            // The next row is half a period aside.
            let moved = |ends: &Ends| {
                [0, 1].map(|axis| {
                    let by = [0.5, 1.0][axis] * self.period[axis];
                    ends[axis].map(|end| end + by)
                })
            };
            boxes.extend(boxes.clone().iter().map(moved));
            period[1] *= 2.0;
        }
        let centre = [0, 1].map(|axis| {
            let between = if pixels[axis].is_multiple_of(2) { 0.5 } else { 0.0 };
            self.offset[axis] + between * self.period[axis]
        });
        let Self { distance, leak, .. } = *self;
        Sheet { distance, period, centre, boxes, leak }
    }
}

/// A set-up with masks of its own.
#[derive(Debug, Clone)]
struct Case {
    setup: Setup,
    masks: [Option<Planned>; 2],
}

impl Case {
    /// Pixels of 150 um x 120 um; masks 100/20 um x 80/30 um and 150/30 um x 120/45 um.
    fn rectangles(pixels: [u32; 2], leak: f64) -> Self {
        let mut setup = Setup::paper(pixels);
        (setup.sample_mask, setup.detector_mask) = (None, None);
        setup.pitch = [150e-6, 120e-6];
        let shape = ApertureShape::Rectangle;
        let first = Planned {
            distance: 1.2,
            period: [100e-6, 80e-6],
            aperture: [20e-6, 30e-6],
            offset: [0.0, 3e-6],
            shape,
            lattice: ApertureLattice::Rectangular,
            leak,
            rows: &[],
            listed: &[],
        };
        let second = Planned {
            distance: 1.8,
            period: [150e-6, 120e-6],
            aperture: [30e-6, 45e-6],
            offset: [0.0; 2],
            shape,
            lattice: ApertureLattice::Rectangular,
            leak: 0.5 * leak,
            rows: &[],
            listed: &[],
        };
        Self { setup, masks: [Some(first), Some(second)] }
    }

    /// A mask of circles of 15 um alone, periods of 40 um x 42 um, before pixels of 11 um x 13 um.
    fn circles(pixels: [u32; 2]) -> Self {
        let mut case = Self::rectangles(pixels, 0.0);
        case.setup.pitch = [11e-6, 13e-6];
        case.setup.spot = [10e-6, 12e-6];
        let shape = ApertureShape::Round;
        let (period, aperture) = ([40e-6, 42e-6], [15e-6; 2]);
        case.masks[0] = case.masks[0].map(|mask| Planned { period, aperture, shape, ..mask });
        case.masks[1] = None;
        case
    }

    fn scene(&self, bodies: &[Body], offsets: &[[f64; 2]]) -> Scene {
        let along = |axis: usize| offsets.iter().map(|offset| offset[axis]).collect::<Vec<_>>();
        let mut scene = scenes::scene(&self.setup, bodies, &along(0));
        [scene.sample_mask, scene.detector_mask] = self.masks.map(|it| it.map(|mask| mask.spec()));
        scene.scan.mask_offsets_z = along(1);
        scene
    }

    fn sheets(&self, strips: u32) -> [Option<Sheet>; 2] {
        self.masks.map(|mask| mask.map(|mask| mask.sheet(self.setup.pixels, strips)))
    }

    /// Light of a pixel without a sample in closed form, where the detector mask is on the detector.
    fn flat(&self, strips: u32, at: [u32; 2], offset: [f64; 2]) -> f64 {
        let centre = self.setup.centre(at[0], at[1]);
        let own = [0, 1].map(|axis| {
            let half = 0.5 * self.setup.pitch[axis];
            [centre[axis] - half, centre[axis] + half]
        });
        let [first, second] = self.sheets(strips);
        let whole = [[f64::NEG_INFINITY, f64::INFINITY]; 2];
        // Images of apertures, and the light that passes all of them.
        let terms = |sheet: Option<Sheet>| -> Vec<(f64, Option<Sheet>, Ends)> {
            let Some(sheet) = sheet else { return vec![(1.0, None, whole)] };
            let open =
                sheet.boxes.iter().map(|ends| (1.0 - sheet.leak, Some(sheet.clone()), *ends));
            std::iter::once((sheet.leak, None, whole)).chain(open).collect()
        };
        let (first, second) = (terms(first.map(|sheet| sheet.moved(offset))), terms(second));
        let mut sum = 0.0;
        for (share, sheet, ends) in &first {
            for (share_behind, behind, ends_behind) in &second {
                let along = |axis: usize| {
                    let windows = placed(behind.as_ref(), axis, ends_behind[axis], own[axis], 1.0);
                    let scale =
                        sheet.as_ref().map_or(1.0, |it| self.setup.detector_distance / it.distance);
                    let far = [own[axis][0] - 200e-6, own[axis][1] + 200e-6];
                    let images = placed(sheet.as_ref(), axis, ends[axis], far, scale);
                    let blur = (scale - 1.0) * self.setup.sigma()[axis];
                    overlaps(&images, &windows, blur) / self.setup.pitch[axis]
                };
                sum += share * share_behind * along(0) * along(1);
            }
        }
        sum
    }
}

/// Apertures along an axis, `scale` times as large, cut to a range; the range where there is no sheet.
fn placed(
    sheet: Option<&Sheet>,
    axis: usize,
    ends: [f64; 2],
    range: [f64; 2],
    scale: f64,
) -> Vec<[f64; 2]> {
    let Some(sheet) = sheet else { return vec![range] };
    let period = sheet.period[axis] * scale;
    let centre = sheet.centre[axis] * scale;
    let [first, last] = range.map(|at| ((at - centre) / period).round() as i64);
    (first - 1..=last + 1)
        .map(|k| ends.map(|end| centre + k as f64 * period + end * scale))
        .filter_map(|[low, high]| {
            let part =
                if scale <= 1.0 { [low.max(range[0]), high.min(range[1])] } else { [low, high] };
            (part[1] > part[0]).then_some(part)
        })
        .collect()
}

fn overlaps(images: &[[f64; 2]], windows: &[[f64; 2]], blur: f64) -> f64 {
    let of = |image: &[f64; 2], window: &[f64; 2]| {
        let [a, b] = [image, window].map(|[low, high]| (0.5 * (low + high), high - low));
        blurred_overlap(a.0 - b.0, a.1, b.1, blur)
    };
    images.iter().flat_map(|image| windows.iter().map(move |window| of(image, window))).sum()
}

fn stack(engine: &Checked, scene: &Scene) -> Array3<f32> {
    let stacks = engine.simulate(scene).expect("a stack");
    assert_eq!(stacks.record.tally.unbalanced, 0);
    stacks.sample.index_axis_move(ndarray::Axis(0), 0)
}

/// Takes the differences of flats at `STEPS` to the closed form.
fn take_flats(worst: &mut Worst, case: &Case, flats: &Array3<f32>, what: &str) {
    for ((step, row, column), &got) in flats.indexed_iter() {
        let want = case.flat(1, [column as u32, row as u32], STEPS[step]);
        worst.take(f64::from(got) - want, || {
            format!("{what}, step {step}, pixel {column}, {row}: {got} for {want}")
        });
    }
}

fn carbon(mesh: Mesh) -> Body {
    body(mesh.rounded(), CARBON[0], CARBON[1])
}

/// Steps along x, along z, and along both.
const STEPS: [[f64; 2]; 5] =
    [[0.0, 0.0], [7e-6, 0.0], [0.0, 10e-6], [-9e-6, 22e-6], [31e-6, -47e-6]];

#[test]
fn flats_of_rectangles_are_products_of_closed_forms() {
    let mut worst = Worst::new("flat of rectangles, closed form", SAME_MASKS);
    let engine = engine(Backend::Bvh);
    for (leak, spot) in [(0.0, [30e-6, 40e-6]), (0.2, [30e-6, 40e-6]), (0.2, [0.0; 2])] {
        for pixels in [[6, 5], [3, 4]] {
            let mut case = Case::rectangles(pixels, leak);
            case.setup.spot = spot;
            let got = stack(&engine, &case.scene(&[], &STEPS));
            take_flats(&mut worst, &case, &got, &format!("leak {leak}, spot {spot:?}"));
        }
    }
    worst.holds();
}

#[test]
fn flats_of_one_mask_alone_are_products_of_closed_forms() {
    let mut worst = Worst::new("flat of one mask, closed form", SAME_MASKS);
    let engine = engine(Backend::Bvh);
    for alone in [0, 1] {
        let mut case = Case::rectangles([5, 6], 0.1);
        case.masks[1 - alone] = None;
        // Several pixels of each aperture, whose borders are elsewhere in each.
        case.setup.pitch = [37e-6, 29e-6];
        let mut scene = case.scene(&[], &STEPS[..1]);
        scene.scan.mask_offsets_z.clear();
        let got = stack(&engine, &scene);
        for ((_, row, column), &got) in got.indexed_iter() {
            let want = case.flat(1, [column as u32, row as u32], [0.0; 2]);
            worst.take(f64::from(got) - want, || {
                format!("mask {alone}, pixel {column}, {row}: {got} for {want}")
            });
        }
    }
    worst.holds();
}

#[test]
fn flats_of_circles_are_sums_over_their_chords() {
    let mut worst = Worst::new("flat of circles, quadrature", STRIPS);
    let engine = engine(Backend::Bvh);
    let case = Case::circles([12, 11]);
    let got = stack(&engine, &case.scene(&[], &STEPS));
    let mut light = 0.0;
    for ((step, row, column), &got) in got.indexed_iter() {
        let want = case.flat(400, [column as u32, row as u32], STEPS[step]);
        light += want;
        worst.take(f64::from(got) - want, || {
            format!("step {step}, pixel {column}, {row}: {got} for {want}")
        });
    }
    assert!(light > 1.0, "{light}");
    worst.holds();
}

/// A coded pattern with runs across the ends of rows, equal rows, a full row and an empty one.
const CODED: &[&str] = &[
    "1001011", "0110100", "0110100", "1111111", "0000000", "1010011", "0011001", "1100110",
    "0101010",
];

/// The same with x and z exchanged: columns from the right as rows, each from below.
const EXCHANGED: &[&str] =
    &["001101001", "110101001", "010001110", "101001001", "001101110", "110001110", "010101001"];

/// Periods of 100 um x 80 um with an opening of 20 um x 30 um.
const ONE_OPENING: &[&str] = &[
    "00000", "00000", "00000", "00000", "00000", "00100", "00100", "00100", "00100", "00100",
    "00100", "00000", "00000", "00000", "00000", "00000",
];

/// Rectangles that touch each other, that touch the end of the period, above each other and displaced along z.
const LISTED: &[[f64; 4]] = &[
    [-150e-6, 120e-6, 110e-6, 60e-6],
    [-70e-6, 95e-6, 50e-6, 90e-6],
    [60e-6, 20e-6, 40e-6, 130e-6],
    [160e-6, -110e-6, 35e-6, 45e-6],
    [-40e-6, -90e-6, 80e-6, 30e-6],
    [190e-6, 60e-6, 30e-6, 40e-6],
];

/// The same after a quarter turn from +z to +x.
const TURNED: &[[f64; 4]] = &[
    [120e-6, 150e-6, 60e-6, 110e-6],
    [95e-6, 70e-6, 90e-6, 50e-6],
    [20e-6, -60e-6, 130e-6, 40e-6],
    [-110e-6, -160e-6, 45e-6, 35e-6],
    [-90e-6, 40e-6, 30e-6, 80e-6],
    [60e-6, -190e-6, 40e-6, 30e-6],
];

/// Two rows of two openings of the lattice of 100 um x 80 um.
const FOUR_OPENINGS: &[[f64; 4]] = &[
    [-50e-6, -40e-6, 20e-6, 30e-6],
    [50e-6, -40e-6, 20e-6, 30e-6],
    [50e-6, 40e-6, 20e-6, 30e-6],
    [-50e-6, 40e-6, 20e-6, 30e-6],
];

/// Cells of a pattern end at the middle of its opening, too, and differ from cells of rectangles.
#[test]
fn a_pattern_of_one_opening_is_a_lattice_of_rectangles() {
    let case = Case::rectangles([4, 3], 0.1);
    let names = ["pattern of one opening, flats", "pattern of one opening, sphere"];
    is_the_lattice(names, &case, |mask| mask.patterned(ONE_OPENING));
}

#[test]
fn a_list_of_four_openings_is_a_lattice_of_rectangles() {
    let case = Case::rectangles([4, 4], 0.1);
    let names = ["list of four openings, flats", "list of four openings, sphere"];
    is_the_lattice(names, &case, |mask| {
        Planned { period: [200e-6, 160e-6], ..mask }.listed(FOUR_OPENINGS)
    });
}

/// Compares the sample mask of a case with the same openings in other words, without and with a ball.
fn is_the_lattice(names: [&'static str; 2], case: &Case, other: fn(Planned) -> Planned) {
    let engine = engine(Backend::Bvh);
    let mut changed = case.clone();
    changed.masks[0] = changed.masks[0].map(other);
    let mut flats = Worst::new(names[0], SAME_MASKS);
    let mut balls = Worst::new(names[1], 1e-4);
    let ball = [carbon(sphere(230e-6, 3).moved([30e-6, 0.0, -12e-6]))];
    for (worst, bodies) in [(&mut flats, &[][..]), (&mut balls, &ball[..])] {
        let [want, got] = [case, &changed].map(|it| stack(&engine, &it.scene(bodies, &STEPS)));
        for ((at, got), want) in got.indexed_iter().zip(&want) {
            worst.take(f64::from(got - want), || format!("{at:?}: {got} for {want}"));
        }
    }
    flats.holds();
    balls.holds();
}

#[test]
fn flats_of_patterns_are_sums_over_their_pixels() {
    flats_of_lists("flat of patterns, closed form", |mask| mask.patterned(CODED));
}

#[test]
fn flats_of_lists_are_sums_over_their_rectangles() {
    flats_of_lists("flat of rectangles in a list, closed form", |mask| mask.listed(LISTED));
}

/// Masks with a period of 410 um x 370 um, before and behind the sample and both.
fn flats_of_lists(name: &'static str, list: fn(Planned) -> Planned) {
    let mut worst = Worst::new(name, SAME_MASKS);
    let engine = engine(Backend::Bvh);
    for patterned in [[true, false], [false, true], [true, true]] {
        let mut case = Case::rectangles([5, 4], 0.2);
        for (mask, _) in case.masks.iter_mut().zip(patterned).filter(|(_, is)| *is) {
            *mask = mask.map(|mask| list(Planned { period: [410e-6, 370e-6], ..mask }));
        }
        let got = stack(&engine, &case.scene(&[], &STEPS));
        take_flats(&mut worst, &case, &got, &format!("{patterned:?}"));
    }
    worst.holds();
}

#[test]
fn flats_behind_a_turned_list_are_sums_over_the_turned_rectangles() {
    let mut worst = Worst::new("flat of a turned list, closed form", SAME_MASKS);
    let mut case = Case::rectangles([5, 4], 0.2);
    let mut mask = case.masks[0].expect("a mask").listed(LISTED);
    mask.period = [410e-6, 370e-6];
    let turned = mask.spec().rotated(std::f64::consts::FRAC_PI_2).expect("a quarter turn");
    mask.period.reverse();
    case.masks[0] = Some(mask.listed(TURNED));
    let mut scene = case.scene(&[], &STEPS);
    scene.sample_mask = Some(turned);
    let got = stack(&engine(Backend::Bvh), &scene);
    take_flats(&mut worst, &case, &got, "turned list");
    worst.holds();
}

#[test]
fn cells_behind_a_list_are_the_mean_of_random_rays() {
    let mut case = Case::rectangles([3, 3], 0.1);
    case.masks[0] =
        case.masks[0].map(|mask| Planned { period: [410e-6, 370e-6], ..mask }.listed(LISTED));
    compare_with_random("list, cells against random rays", &case, 50_000);
}

#[test]
fn cells_behind_a_pattern_are_the_mean_of_random_rays() {
    let mut case = Case::rectangles([3, 3], 0.1);
    case.masks[0] =
        case.masks[0].map(|mask| Planned { period: [210e-6, 180e-6], ..mask }.patterned(CODED));
    compare_with_random("pattern, cells against random rays", &case, 50_000);
}

/// Compares cells with random rays by the change that a ball makes: flat and sample have the same
/// random rays, so that most of their noise cancels. What is left has a standard deviation of 7e-5
/// at 100,000 rays of a pixel.
fn compare_with_random(what: &'static str, case: &Case, rays: u32) {
    let mut worst = Worst::new(what, 3e-4 * (100_000.0 / f64::from(rays)).sqrt());
    let engine = engine(Backend::Bvh);
    let ball = carbon(sphere(260e-6, 3).moved([20e-6, 0.0, -15e-6]));
    let mut scene = case.scene(&[ball], &STEPS[2..]);
    let change = |scene: &Scene| {
        let stacks = engine.simulate(scene).expect("a stack");
        stacks.sample.index_axis_move(ndarray::Axis(0), 0) - stacks.flat
    };
    let cells = change(&scene);
    scene.sampling.scheme = Scheme::Random;
    scene.sampling.rays = RandomRays::Count(rays);
    let random = change(&scene);
    assert!(cells.iter().any(|change| change.abs() > 5e-4), "{cells}");
    for ((step, row, column), &got) in cells.indexed_iter() {
        let want = random[[step, row, column]];
        worst.take(f64::from(got - want), || {
            format!("step {step}, pixel {column}, {row}: {got} for {want}")
        });
    }
    worst.holds();
}

#[test]
fn cells_are_the_mean_of_random_rays() {
    let mut case = Case::rectangles([3, 3], 0.1);
    // Behind the detector mask there is a gap.
    case.masks[1] = case.masks[1].map(|mask| Planned { distance: 1.75, ..mask });
    compare_with_random("cells against random rays", &case, 100_000);
}

#[test]
fn cells_behind_hexagonal_lattices_are_the_mean_of_random_rays() {
    let mut case = Case::rectangles([3, 3], 0.1);
    case.masks = case.masks.map(|it| it.map(Planned::hexagonal));
    compare_with_random("hexagonal lattice, cells against random rays", &case, 100_000);
}

/// A wedge that is thicker towards +z deflects light towards -z, as much as a step of the sample mask along -z over the
/// magnification moves it. Its slanting face is within 0.4 mm of the rotation centre.
#[test]
fn a_wedge_moves_light_along_z_as_a_step_of_the_mask_does() {
    let case = Case::rectangles([3, 3], 0.0);
    let engine = engine(Backend::Bvh);
    let (slope, delta) = (0.5_f64, 2e-5);
    let half = 0.7e-3;
    // Section in y and z: a vertical face in front, and one that slants behind.
    let section =
        [[-half, -0.5 * slope * half], [half, -0.5 * slope * half], [half, 1.5 * slope * half]];
    let mesh = extruded(&section, 0.7e-3).turned([0.0, 1.0, 0.0], -std::f64::consts::FRAC_PI_2);
    let weak = body(mesh.rounded(), 0.0, delta);
    let moved = -delta * slope * (1.8 - 1.21) / 1.5;
    let offsets = [[0.0, 5e-6], [4e-6, -7e-6]];
    let scene = case.scene(&[weak], &offsets);
    let mut worst = Worst::new("wedge along z", 5e-5);
    let got = stack(&engine, &scene);
    for (step, [x, z]) in offsets.into_iter().enumerate() {
        let [want, still] = [moved, 0.0].map(|moved| case.flat(1, [1, 1], [x, z + moved]));
        assert!((want - still).abs() > 5e-3, "{want} {still}");
        worst.take(f64::from(got[[step, 1, 1]]) - want, || {
            format!("step {step}: {want}, without {still}")
        });
    }
    worst.holds();
}

#[test]
fn a_sphere_has_the_light_of_the_reference() {
    let case = Case::rectangles([4, 4], 0.05);
    let ball = carbon(sphere(260e-6, 3).moved([30e-6, 0.0, 20e-6]));
    let scene = case.scene(std::slice::from_ref(&ball), &STEPS);
    let stack = stack(&engine(Backend::Bvh), &scene);
    let sample = Sample::new(&[ball], case.setup.source_distance, 0.0);
    let [first, second] = case.sheets(1);
    let how = Fineness { squares: 24, sources: [41, 41], beside: 2 };
    let mut worst = Worst::new("sphere against the reference", 3e-4);
    for at in [[2, 1], [2, 2]] {
        let want =
            pixel(&case.setup, [first.as_ref(), second.as_ref()], Some(&sample), how, at, &STEPS);
        for (step, want) in want.into_iter().enumerate() {
            let got = f64::from(stack[[step, at[1] as usize, at[0] as usize]]);
            worst.take(got - want, || format!("step {step}, pixel {at:?}: {got} for {want}"));
        }
    }
    worst.holds();
}

#[test]
fn exchanged_axes_give_the_exchanged_stack() {
    exchanges_axes(("exchanged axes", 1e-4), |_, mask| mask);
}

#[test]
fn exchanged_axes_of_a_pattern_give_the_exchanged_stack() {
    // Both stacks may err by the tolerance of their sampling, 1e-4.
    exchanges_axes(("exchanged axes, pattern", 2e-4), |exchanged, mask| {
        mask.patterned(if exchanged { EXCHANGED } else { CODED })
    });
}

/// A ball before a case of its own, and with x and z of everything exchanged: row r counts down.
/// `first` makes the sample mask of the case, and of the exchanged one.
fn exchanges_axes((name, most): (&'static str, f64), first: fn(bool, Planned) -> Planned) {
    let mut worst = Worst::new(name, most);
    let engine = engine(Backend::Bvh);
    let mut case = Case::rectangles([3, 2], 0.1);
    // Behind the detector mask there is a gap.
    case.masks[1] =
        case.masks[1].map(|mask| Planned { distance: 1.77, offset: [4e-6, 0.0], ..mask });
    let mut turned = case.clone();
    turned.setup.pixels.reverse();
    turned.setup.pitch.reverse();
    turned.setup.spot.reverse();
    for mask in turned.masks.iter_mut().flatten() {
        for pair in [&mut mask.period, &mut mask.aperture, &mut mask.offset] {
            pair.reverse();
        }
    }
    for (case, exchanged) in [(&mut case, false), (&mut turned, true)] {
        case.masks[0] = case.masks[0].map(|mask| first(exchanged, mask));
    }
    let ball = |x: f64, z: f64| carbon(sphere(230e-6, 3).moved([x, 0.0, z]));
    let exchanged = STEPS.map(|[x, z]| [z, x]);
    let got = stack(&engine, &case.scene(&[ball(30e-6, -12e-6)], &STEPS));
    let other = stack(&engine, &turned.scene(&[ball(-12e-6, 30e-6)], &exchanged));
    let [columns, rows] = case.setup.pixels.map(|count| count as usize);
    for ((step, row, column), &got) in got.indexed_iter() {
        let other = other[[step, columns - 1 - column, rows - 1 - row]];
        worst.take(f64::from(got - other), || {
            format!("step {step}, pixel {column}, {row}: {got} and {other}")
        });
    }
    worst.holds();
}

#[test]
fn bands_batches_and_backends_change_no_bit_behind_apertures() {
    let first = Case::rectangles([3, 3], 0.05).scene(&[carbon(sphere(230e-6, 2))], &STEPS[3..]);
    let mut case = Case::rectangles([3, 2], 0.05);
    case.masks[0] =
        case.masks[0].map(|mask| Planned { period: [210e-6, 180e-6], ..mask }.patterned(CODED));
    let pattern = case.scene(&[carbon(sphere(150e-6, 2))], &STEPS[3..]);
    for (name, scene) in [("rectangles", &first), ("a pattern", &pattern)] {
        let cuts = [Cut { batch: Some(397), ..bands(1) }];
        let whole = no_bit_changes(name, scene, &cuts).sample;
        for backend in backends().into_iter().skip(1) {
            let mut worst = Worst::new("backends behind apertures", 1e-6);
            let other = engine(backend).simulate(scene).expect("a stack").sample;
            for (got, want) in other.iter().zip(&whole) {
                worst.take(f64::from(got - want), || format!("{backend:?}: {got} for {want}"));
            }
            worst.holds();
        }
    }
}

/// Apertures and leaks of a mask on a plate, under both schemes; the secant of 0.3 mrad is 1 to 1e-7.
#[test]
fn substrates_dim_the_light_of_apertures_and_of_leaks() {
    let engine = engine(Backend::Bvh);
    let mut worst = Worst::new("substrate of apertures", 1e-6);
    let mut scene = Case::rectangles([3, 2], 0.2).scene(&[], &STEPS);
    scene.sampling.rays = RandomRays::Count(64);
    for scheme in [Scheme::Cells, Scheme::Random] {
        scene.sampling.scheme = scheme;
        for mask in [&mut scene.sample_mask, &mut scene.detector_mask].into_iter().flatten() {
            mask.substrate = None;
        }
        let plain = stack(&engine, &scene);
        for mask in [&mut scene.sample_mask, &mut scene.detector_mask].into_iter().flatten() {
            mask.substrate = Some(Substrate::new("silicon", 300e-6));
        }
        let share = (-constants_at(&scene, "silicon", 30.0).expect("silicon").mu * 600e-6).exp();
        assert!(share < 0.9, "{share}");
        for (got, plain) in stack(&engine, &scene).iter().zip(&plain) {
            worst
                .take(f64::from(*got) - share * f64::from(*plain), || format!("{scheme:?}: {got}"));
        }
    }
    worst.holds();
}

/// Rows of apertures beside each other, before both, one and no detector mask; steps over the border of a period.
#[test]
fn flats_of_hexagonal_lattices_are_products_of_closed_forms() {
    let mut worst = Worst::new("flat of hexagonal lattices, closed form", SAME_MASKS);
    let engine = engine(Backend::Bvh);
    for pixels in [[6, 5], [3, 4]] {
        for both in [true, false] {
            let mut case = Case::rectangles(pixels, 0.1);
            case.masks[0] = case.masks[0].map(Planned::hexagonal);
            if both {
                case.masks[1] = case.masks[1].map(Planned::hexagonal);
            } else {
                case.masks[1] = None;
                case.setup.pitch = [37e-6, 29e-6];
            }
            let got = stack(&engine, &case.scene(&[], &STEPS));
            take_flats(&mut worst, &case, &got, &format!("both {both}"));
        }
    }
    worst.holds();
}

/// Makes the bars of both masks 100 um of gold, before the detector.
fn gold(scene: &mut Scene) {
    for mask in [&mut scene.sample_mask, &mut scene.detector_mask].into_iter().flatten() {
        mask.body = MaskBody::Bars { material: "gold".into(), thickness: 100e-6 };
    }
    scene.detector_mask.as_mut().expect("a detector mask").distance = 1.8 - 50e-6;
}

/// Edges of 100 um of gold at 2.7 mrad along z shade 0.3 um of apertures whose strips are 0.4 um high and more. Random
/// rays pass the bars along their paths; the mean of 240 values has a standard deviation of 0.2 % by 10,000 rays.
#[test]
fn thick_bars_of_circles_and_crosses_let_through_what_random_rays_do() {
    let engine = engine(Backend::Bvh);
    let shapes = vec![ApertureShape::Round, ApertureShape::Cross, ApertureShape::Rectangle];
    for shape in sample(shapes, 3) {
        let mut worst = Worst::new("thick bars off the axis, of the light", 8e-3);
        let mut case = Case::rectangles([3, 80], 0.0);
        case.masks = case.masks.map(|mask| mask.map(|mask| Planned { shape, ..mask }));
        let mut scene = case.scene(&[], &STEPS[..2]);
        gold(&mut scene);
        scene.sampling.rays = RandomRays::Count(amount(4_000, 10_000));
        let mut light = |scheme: Scheme| {
            scene.sampling.scheme = scheme;
            let flat = engine.simulate(&scene).expect("a stack").flat;
            let rows = (0..20).chain(60..80).map(|row| {
                flat.index_axis(ndarray::Axis(1), row).iter().copied().map(f64::from).sum::<f64>()
            });
            rows.sum::<f64>()
        };
        let [cells, random] = [Scheme::Cells, Scheme::Random].map(&mut light);
        worst.take(cells / random - 1.0, || format!("{shape:?}: {cells} for {random}"));
        worst.holds();
    }
}

/// Bars of gold that leak as energies do and shade up to 0.25 um of an aperture along z, before a ball of aluminium:
/// energies share cells, and may not all share an edge. The mean of runs at single energies has no such cells.
#[test]
fn light_of_a_spectrum_behind_apertures_is_the_mean_of_its_energies() {
    let place = tempfile::tempdir().expect("a place");
    let path = place.path().join("lines.csv");
    let energies = amount(vec![40.0, 80.0], vec![40.0, 52.0, 66.0, 80.0]);
    let count = u32::try_from(energies.len()).expect("few energies");
    let rows: String = energies.iter().map(|energy| format!("{energy},1\n")).collect();
    std::fs::write(&path, format!("energy_keV,weight\n{rows}")).expect("a spectrum");
    for (what, heights) in [("near the axis", 0.0), ("at 2.5 mrad", -3e-3)] {
        let case = Case::rectangles([3, if heights < 0.0 { 81 } else { 4 }], 0.0);
        let ball = carbon(sphere(260e-6, 3).moved([20e-6, 0.0, heights - 15e-6]));
        let mut scene = case.scene(&[ball], &STEPS[2..]);
        gold(&mut scene);
        scene.sampling.tolerance = Some(1e-4);
        scene.objects.iter_mut().for_each(|object| object.material = "aluminium".into());
        let engine = engine(Backend::Bvh);
        let mut at = |beam: Beam| {
            scene.source.beam = beam;
            let stacks = engine.simulate(&scene).expect("a stack");
            let flat = stacks.flat.insert_axis(ndarray::Axis(0));
            ndarray::concatenate![ndarray::Axis(0), stacks.sample, flat]
        };
        let of_one: Vec<_> = energies.iter().map(|energy| at(Beam::Energy(*energy))).collect();
        let origin = SpectrumOrigin::File { path: path.clone() };
        let got = at(Beam::Spectrum(SpectrumSpec::new(origin).with_nodes(count)));
        let mut flat = Worst::new("spectrum behind apertures, flat", 2e-5);
        let mut worst = Worst::new("spectrum behind apertures, sample", 5e-4);
        let mut change: f32 = 0.0;
        for (at, &got) in got.indexed_iter() {
            let want = of_one.iter().map(|one| f64::from(one[at])).sum::<f64>() / f64::from(count);
            change = change.max((of_one[0][at] - of_one[of_one.len() - 1][at]).abs());
            let worst = if at.0 == 1 { &mut flat } else { &mut worst };
            worst.take(f64::from(got) - want, || format!("{what}, {at:?}: {got} for {want}"));
        }
        assert!(change > 5e-3, "{what}: energies differ, {change}");
        flat.holds();
        worst.holds();
    }
}
