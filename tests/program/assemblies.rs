//! Overlaps that `check` prints of assemblies, by the real binary: one line for each pair.

use crate::support::program::{done, workplace};
use std::fmt::Write as _;

const SET_UP: &str = r#"
source = { distance = "1.2 m", spot = "0 um", energy = "30 keV" }
detector = { distance = "1.8 m", pixels = [16, 16], pitch = "1 mm" }
"#;

const CUBE: &str = "box = { size = [\"1 mm\", \"1 mm\", \"1 mm\"] }";
const BALL: &str = "sphere = { radius = \"0.5 mm\" }";
const DISC: &str = "cylinder = { radius = \"0.5 mm\", height = \"0.4 mm\" }";
const RING: &str = "tube = { outer = \"0.5 mm\", inner = \"0.3 mm\", height = \"0.2 mm\" }";
const BEAD: &str = "sphere = { radius = \"0.1 mm\" }";

#[test]
fn check_prints_one_line_for_each_overlap() {
    // Places of the second, mm, and whether it overlaps the first.
    let pairs = [
        (CUBE, CUBE, [0.7, 0.2, 0.0], true),
        (CUBE, BALL, [0.5, 0.0, 0.0], true),
        (BALL, CUBE, [0.5, 0.0, 0.0], true),
        (BEAD, CUBE, [0.0; 3], true),
        (DISC, BALL, [0.0, 0.0, 0.2], true),
        (BEAD, BALL, [0.1, 0.0, 0.0], true),
        (DISC, DISC, [0.0, 0.0, 0.4], false),
        (CUBE, DISC, [0.0, 0.0, 0.7], false),
        (CUBE, CUBE, [1.0005, 0.0, 0.0], false),
        (RING, BEAD, [0.0, 0.600_3, 0.0], false),
        (CUBE, BEAD, [0.1, 0.1, 0.1], false),
    ];
    let (mut scene, mut want) = (SET_UP.to_owned(), Vec::new());
    let off = [-4.5, -1.5, 1.5, 4.5];
    for (number, (first, second, apart, overlaps)) in pairs.into_iter().enumerate() {
        for (name, shape, at) in [("a", first, [0.0; 3]), ("b", second, apart)] {
            let [x, y, z] = [at[0] + off[number % 4], at[1], at[2] + off[number / 4]];
            writeln!(
                scene,
                "[[object]]\nname = \"{name}{number}\"\nmaterial = \"carbon\"\nshape = {{ {shape} }}\n\
                 position = [\"{x} mm\", \"{y} mm\", \"{z} mm\"]"
            )
            .unwrap();
        }
        if overlaps {
            want.push(format!("  \"a{number}\" overlaps \"b{number}\": \"b{number}\" wins"));
        }
    }
    let place = workplace(&scene);
    let report = done(place.path(), "check scene.toml --no-estimate");
    let lines: Vec<&str> = report.lines().filter(|it| it.contains("\" overlaps \"")).collect();
    assert_eq!(lines, want, "{report}");
}
