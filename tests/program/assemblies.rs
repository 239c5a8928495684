//! What `check` prints of assemblies, by the real binary: one line for each pair that overlaps,
//! touches or nearly does, with its size within 5 % and its place.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use crate::support::program::{done, workplace};
use std::f64::consts::PI;
use std::fmt::Write as _;

const SET_UP: &str = r#"
[source]
distance = "1.2 m"
spot = "0 um"
energy = "30 keV"
[detector]
distance = "1.8 m"
pixels = [16, 16]
pitch = "1 mm"
"#;

/// Two objects, by their shapes and places, mm; and their line.
struct Pair {
    shapes: [(&'static str, [f64; 3]); 2],
    kind: Kind,
    /// The place lies within this of the middle, mm, along each axis.
    place: ([f64; 3], f64),
}

#[derive(Clone, Copy)]
enum Kind {
    /// mm3; how deep points of one surface lie in the other body, um.
    Overlap(f64, f64),
    /// mm2.
    Touch(f64),
    Line,
    /// um.
    Gap(f64),
    None,
}

const CUBE: &str = "box = { size = [\"1 mm\", \"1 mm\", \"1 mm\"] }";
const BALL: &str = "sphere = { radius = \"0.5 mm\" }";
const DISC: &str = "cylinder = { radius = \"0.5 mm\", height = \"0.4 mm\" }";
const CONE: &str = "cone = { radius = \"0.5 mm\", top_radius = \"0.2 mm\", height = \"0.4 mm\" }";
const RING: &str = "tube = { outer = \"0.5 mm\", inner = \"0.3 mm\", height = \"0.2 mm\" }";
const BEAD: &str = "sphere = { radius = \"0.1 mm\" }";

fn pairs() -> Vec<Pair> {
    let pair = |a, b, apart, kind, place| Pair { shapes: [(a, [0.0; 3]), (b, apart)], kind, place };
    let ball = 4.0 / 3.0 * PI * 0.125;
    vec![
        pair(CUBE, CUBE, [0.7, 0.2, 0.0], Kind::Overlap(0.24, 300.0), ([0.35, 0.1, 0.0], 0.5)),
        pair(CUBE, BALL, [0.5, 0.0, 0.0], Kind::Overlap(0.5 * ball, 500.0), ([0.2; 3], 0.5)),
        pair(BALL, CUBE, [0.5, 0.0, 0.0], Kind::Overlap(0.5 * ball, 500.0), ([0.2; 3], 0.5)),
        pair(BEAD, CUBE, [0.0; 3], Kind::Overlap(4e-3 / 3.0 * PI, 442.3), ([0.0; 3], 0.2)),
        pair(DISC, DISC, [0.0, 0.0, 0.4], Kind::Touch(PI * 0.25), ([0.0, 0.0, 0.2], 0.51)),
        pair(CUBE, DISC, [0.0, 0.0, 0.7], Kind::Touch(PI * 0.25), ([0.0, 0.0, 0.5], 0.51)),
        pair(DISC, CONE, [0.0, 0.0, 0.4], Kind::Touch(PI * 0.25), ([0.0, 0.0, 0.2], 0.51)),
        pair(CUBE, CUBE, [1.0, 1.0, 0.3], Kind::Line, ([0.5, 0.5, 0.0], 0.5)),
        pair(CUBE, CUBE, [1.0005, 0.0, 0.0], Kind::Gap(0.5), ([0.5, 0.0, 0.0], 0.51)),
        pair(DISC, DISC, [0.0, 0.0, 0.400_002], Kind::Gap(2e-3), ([0.0, 0.0, 0.2], 0.51)),
        pair(DISC, CONE, [0.0, 0.0, 0.4001], Kind::Gap(0.1), ([0.0, 0.0, 0.2], 0.51)),
        pair(BALL, CUBE, [0.0, 1.0002, 0.0], Kind::Gap(0.2), ([0.0, 0.5, 0.0], 0.01)),
        pair(RING, BEAD, [0.0, 0.600_3, 0.0], Kind::Gap(0.3), ([0.0, 0.5, 0.0], 0.01)),
        pair(BALL, BALL, [0.6, 0.0, 0.8009], Kind::Gap(0.72), ([0.3, 0.0, 0.4], 0.01)),
        pair(CUBE, BALL, [0.0, 1.003, 0.0], Kind::None, ([0.0; 3], 0.0)),
        pair(CUBE, BEAD, [0.1, 0.1, 0.1], Kind::None, ([0.0; 3], 0.0)),
    ]
}

/// Numbers of a text, in order.
fn numbers(text: &str) -> Vec<f64> {
    let of = |word: &str| word.trim_matches(|it| "();,".contains(it)).parse().ok();
    text.split_whitespace().filter_map(of).collect()
}

#[test]
fn check_prints_one_line_for_each_overlap_contact_and_gap() {
    let mut scene = SET_UP.to_owned();
    let pairs = pairs();
    let middle = |number: usize| {
        let off = [-4.5, -1.5, 1.5, 4.5];
        [off[number % 4], 0.0, off[number / 4]]
    };
    for (number, Pair { shapes, .. }) in pairs.iter().enumerate() {
        for (name, (shape, at)) in ["a", "b"].iter().zip(shapes) {
            let at = [0, 1, 2].map(|k| at[k] + middle(number)[k]);
            let [x, y, z] = at;
            writeln!(
                scene,
                "[[object]]\nname = \"{name}{number}\"\nmaterial = \"carbon\"\nshape = {{ {shape} }}\n\
                 position = [\"{x} mm\", \"{y} mm\", \"{z} mm\"]"
            )
            .unwrap();
        }
    }
    let place = workplace(&scene);
    let told = done(place.path(), "check scene.toml --no-estimate");
    let lines: Vec<&str> =
        told.lines().skip_while(|it| !it.starts_with("overlaps, contacts and gaps")).collect();
    for (number, Pair { kind, place: (at, within), .. }) in pairs.iter().enumerate() {
        let names = format!("\"a{number}\" and \"b{number}\" ");
        let own: Vec<&str> =
            lines.iter().filter_map(|it| it.trim_start().strip_prefix(&names)).collect();
        if let Kind::None = kind {
            assert!(own.is_empty(), "{own:?}");
            continue;
        }
        let [line] = own[..] else { panic!("{number}: {own:?} in {told}") };
        let (size, near) = line.split_once("; near ").unwrap();
        let (word, want) = match *kind {
            Kind::Overlap(volume, depth) => ("overlap", vec![volume, depth]),
            Kind::Touch(area) => ("touch", vec![area]),
            Kind::Line => ("touch in a line", vec![]),
            Kind::Gap(width) => ("nearly touch", vec![width]),
            Kind::None => unreachable!(),
        };
        assert!(size.starts_with(word), "{number}: {line}");
        assert_eq!(size.contains(" wins"), word == "overlap", "{line}");
        let got = numbers(size);
        assert_eq!(got.len(), want.len(), "{number}: {line}");
        for (got, want) in got.iter().zip(&want) {
            assert!((got - want).abs() <= 0.05 * want, "{number}: {line}, not {want}");
        }
        let near = numbers(near);
        for (axis, (got, at)) in near.iter().zip(at).enumerate() {
            let off = (got - at - middle(number)[axis]).abs();
            assert!(near.len() == 3 && off <= within + 1e-3, "{number}: {line}");
        }
    }
    let told_of = lines.iter().filter(|it| it.contains("\" and \"")).count();
    let wanted = pairs.iter().filter(|it| !matches!(it.kind, Kind::None)).count();
    assert_eq!(told_of, wanted, "{told}");
}
