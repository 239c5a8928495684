//! Parts as CAD has them: closed meshes in units of a row, x across the slits, y along the beam, z along a row's height.

use super::super::draws::Draws;
use beamlet_reference::silhouettes::{cone, together};
use beamlet_reference::surfaces::{Mesh, cuboid, prism};
use beamlet_reference::vector::{Vector, cross, dot, length, scaled, sub};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Letters of 3 x 5 squares, rows from above.
const LETTERS: [[u8; 5]; 5] = [
    [0b111, 0b100, 0b110, 0b100, 0b111],
    [0b101, 0b101, 0b111, 0b101, 0b101],
    [0b010, 0b101, 0b111, 0b101, 0b101],
    [0b100, 0b100, 0b100, 0b100, 0b111],
    [0b111, 0b010, 0b010, 0b010, 0b010],
];

/// What a part is drawn from.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sizes {
    /// Thinnest and thickest part, rows.
    pub(crate) thickness: [f64; 2],
    /// Width of a column, rows.
    pub(crate) column: f64,
    /// Longest extent along the beam, rows.
    pub(crate) depth: f64,
}

impl Sizes {
    fn thickness(&self, draws: &mut Draws) -> f64 {
        draws.log_between(self.thickness[0], self.thickness[1])
    }

    /// Extent across the slits: within a beamlet or beyond several.
    fn length(&self, draws: &mut Draws) -> f64 {
        self.column
            * if draws.chance(0.5) { draws.between(0.05, 0.6) } else { draws.between(0.6, 5.0) }
    }

    fn depth(&self, draws: &mut Draws) -> f64 {
        self.depth * draws.log_between(0.05, 1.0)
    }
}

/// Turns about the beam: level, nearly so, or any; then about the other axes.
pub(crate) fn pose(draws: &mut Draws) -> Vec<(Vector, f64)> {
    let mut turns = Vec::new();
    let sign = draws.pick([-1.0, 1.0]);
    let angle = match draws.below(4) {
        0 => 0.0,
        1 => sign * draws.log_between(1e-3, 0.09),
        _ => draws.between(-PI, PI),
    };
    let about_x = match draws.below(4) {
        0 | 1 => 0.0,
        2 => draws.pick([-1.0, 1.0]) * draws.log_between(1e-3, 0.09),
        _ => draws.between(-PI, PI),
    };
    let about_z = if draws.chance(0.5) { draws.between(-PI, PI) } else { 0.0 };
    for turn in [([1.0, 0.0, 0.0], about_x), ([0.0, 1.0, 0.0], angle), ([0.0, 0.0, 1.0], about_z)] {
        if turn.1 != 0.0 {
            turns.push(turn);
        }
    }
    turns
}

/// The mesh behind turns.
pub(crate) fn turned(mesh: Mesh, turns: &[(Vector, f64)]) -> Mesh {
    turns.iter().fold(mesh, |mesh, (axis, angle)| mesh.turned(*axis, *angle))
}

/// A fin or foil.
pub(crate) fn fin(draws: &mut Draws, sizes: Sizes) -> Mesh {
    cuboid([sizes.length(draws), sizes.depth(draws), sizes.thickness(draws)])
}

/// A wire of few sides along x.
pub(crate) fn wire(draws: &mut Draws, sizes: Sizes) -> Mesh {
    let mesh = prism(
        0.5 * sizes.thickness(draws),
        sizes.length(draws),
        draws.whole(3..9),
        draws.uniform(),
    );
    mesh.turned([0.0, 1.0, 0.0], FRAC_PI_2)
}

/// A bar whose end is narrower, down to a point or an edge.
pub(crate) fn tip(draws: &mut Draws, sizes: Sizes) -> Mesh {
    let (long, high) = (sizes.length(draws), sizes.thickness(draws));
    if draws.chance(0.4) {
        let sides = draws.whole(3..12);
        return cone(0.5 * high, long, sides).turned([0.0, 1.0, 0.0], FRAC_PI_2);
    }
    let mut mesh = cuboid([long, sizes.depth(draws), high]);
    let narrow = [draws.between(0.0, 1.0), draws.pick([1e-3, 0.05, 0.5])];
    for v in mesh.vertices.iter_mut().filter(|v| v[0] > 0.0) {
        (v[1], v[2]) = (v[1] * narrow[0].max(1e-3), v[2] * narrow[1]);
    }
    mesh
}

/// A block on one of its edges: a corner points along x.
pub(crate) fn corner(draws: &mut Draws, sizes: Sizes) -> Mesh {
    let side = sizes.column.max(1.0) * draws.between(0.5, 3.0);
    let block = cuboid([side, sizes.depth(draws), side])
        .turned([0.0, 1.0, 0.0], PI / 4.0 + draws.between(-0.3, 0.3));
    block.moved([-side / 2f64.sqrt() + sizes.column * draws.between(-0.5, 0.5), 0.0, 0.0])
}

/// Teeth of a comb, and its spine.
pub(crate) fn comb(draws: &mut Draws, sizes: Sizes) -> Vec<Mesh> {
    let (count, high) = (2 + draws.below(7), sizes.thickness(draws).min(0.5));
    let (long, deep) = (sizes.length(draws), sizes.depth(draws));
    let step = high * draws.between(1.3, 4.0);
    let middle = 0.5 * (count - 1) as f64;
    let mut parts: Vec<Mesh> = (0..count)
        .map(|k| cuboid([long, deep, high]).moved([0.0, 0.0, (k as f64 - middle) * step]))
        .collect();
    let spine = cuboid([0.1 * long, deep * draws.between(0.3, 0.9), count as f64 * step]);
    parts.push(spine.moved([-0.5 * long, 0.0, 0.0]));
    parts
}

/// Struts between the corners of a cell.
pub(crate) fn lattice(draws: &mut Draws, sizes: Sizes) -> Vec<Mesh> {
    let size = [sizes.column * draws.between(0.5, 2.0), sizes.depth * 0.4, draws.between(0.3, 2.0)];
    let radius = 0.5 * sizes.thickness(draws).min(0.3);
    let mut corner = || [0, 1, 2].map(|axis| size[axis] * draws.between(-0.5, 0.5));
    let nodes: Vec<Vector> = (0..5).map(|_| corner()).collect();
    let mut struts = Vec::new();
    for a in 0..nodes.len() {
        for b in 0..a {
            struts.push(strut(nodes[a], nodes[b], radius));
        }
    }
    struts
}

/// A bar of four sides between two places.
fn strut(from: Vector, to: Vector, radius: f64) -> Mesh {
    let along = sub(to, from);
    let long = length(along);
    let middle = [0, 1, 2].map(|axis| 0.5 * (from[axis] + to[axis]));
    let up = scaled(along, 1.0 / long);
    let axis = cross([0.0, 0.0, 1.0], up);
    let mesh = prism(radius, long, 4, 0.1);
    let mesh =
        if length(axis) > 1e-9 { mesh.turned(axis, dot(up, [0.0, 0.0, 1.0]).acos()) } else { mesh };
    mesh.moved(middle)
}

/// A screw along x: sides whose radius follows a helix.
pub(crate) fn thread(draws: &mut Draws, sizes: Sizes) -> Mesh {
    let (pitch, depth) = (draws.log_between(0.1, 1.0), draws.between(0.1, 0.8));
    let radius = sizes.column.min(1.0) * draws.between(0.3, 1.0);
    let (turns, sides, steps) = (4, 12_u32, 6_u32);
    let rings = turns * steps + 1;
    let mut mesh = Mesh { vertices: Vec::new(), triangles: Vec::new() };
    for ring in 0..rings {
        for side in 0..sides {
            let place = f64::from(ring) / f64::from(steps);
            let phase = (place - f64::from(side) / f64::from(sides)).rem_euclid(1.0);
            let r = radius - depth * pitch * (phase - 0.5).abs().min(0.4) * radius.min(1.0);
            let (sin, cos) = (TAU * (f64::from(side) + 0.2) / f64::from(sides)).sin_cos();
            mesh.vertices.push([r * cos, r * sin, pitch * (place - 0.5 * f64::from(turns))]);
        }
    }
    for ring in 0..rings - 1 {
        for side in 0..sides {
            let at = |ring: u32, side: u32| ring * sides + side % sides;
            let [a, b, c, d] =
                [at(ring, side), at(ring, side + 1), at(ring + 1, side + 1), at(ring + 1, side)];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    for (first, upper) in [(0, false), ((rings - 1) * sides, true)] {
        let middle = mesh.vertices.len() as u32;
        let z = mesh.vertices[first as usize][2];
        mesh.vertices.push([0.0, 0.0, z]);
        for side in 0..sides {
            let [a, b] = [first + side, first + (side + 1) % sides];
            mesh.triangles.push(if upper { [a, b, middle] } else { [b, a, middle] });
        }
    }
    mesh.turned([0.0, 1.0, 0.0], FRAC_PI_2)
}

/// A plate across the beam with letters, a ridge or a pit on the side of the source; raised or engraved, with draft.
pub(crate) fn relief(draws: &mut Draws, sizes: Sizes, letters: bool) -> Mesh {
    let (square, draft) = (sizes.thickness(draws).clamp(0.02, 1.0), draws.pick([0.02, 0.1, 0.3]));
    let high = draws.pick([-0.4, 0.4, 1.0]) * sizes.depth * draws.log_between(0.1, 1.0);
    let plate = 0.5 * sizes.depth * draws.between(0.2, 1.0) + high.min(0.0).abs();
    let (squares, pattern): ([usize; 2], Vec<[u8; 5]>) = if letters {
        ([9, 7], vec![draws.pick(LETTERS), draws.pick(LETTERS)])
    } else {
        ([3, 3], Vec::new())
    };
    let raised = |i: usize, j: usize| {
        if pattern.is_empty() {
            return i == 1 && j == 1;
        }
        let (letter, column) = ((i.wrapping_sub(1)) / 4, (i.wrapping_sub(1)) % 4);
        i > 0
            && (1..6).contains(&j)
            && column < 3
            && pattern.get(letter).is_some_and(|it| it[5 - j] >> (2 - column) & 1 == 1)
    };
    // A ridge is long across the slits.
    let stretch = if pattern.is_empty() { sizes.length(draws) } else { square };
    let lines = |count: usize, size: f64, margin: f64| -> Vec<f64> {
        let width = |k: usize| if k == 0 || k + 1 == count { margin } else { size };
        let mut at = -0.5 * (0..count).map(width).sum::<f64>();
        let mut all = vec![at];
        for k in 0..count {
            at += width(k);
            // A wall is a strip between two lines.
            let half = 0.5 * draft * square;
            all.extend(if k + 1 < count { vec![at - half, at + half] } else { vec![at] });
        }
        all
    };
    let xs = lines(squares[0], stretch, sizes.column);
    let zs = lines(squares[1], square, 1.0);
    let height = |i: usize, j: usize| {
        // Corners of the grid belong to the square that both of their lines bound.
        let of = |k: usize| k / 2;
        if raised(of(i), of(j)) { high } else { 0.0 }
    };
    let mut mesh = Mesh { vertices: Vec::new(), triangles: Vec::new() };
    let count = zs.len() as u32;
    for front in [true, false] {
        for (i, x) in xs.iter().enumerate() {
            for (j, z) in zs.iter().enumerate() {
                mesh.vertices.push([*x, if front { -height(i, j) } else { plate }, *z]);
            }
        }
    }
    let side = xs.len() as u32 * count;
    let at = |i: u32, j: u32| i * count + j;
    for i in 0..xs.len() as u32 - 1 {
        for j in 0..count - 1 {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            mesh.triangles.extend([
                [a, b, c],
                [a, c, d],
                [a + side, c + side, b + side],
                [a + side, d + side, c + side],
            ]);
        }
    }
    let mut wall =
        |a: u32, b: u32| mesh.triangles.extend([[b, a, a + side], [b, a + side, b + side]]);
    let last = [xs.len() as u32 - 1, count - 1];
    for i in 0..last[0] {
        wall(at(i, 0), at(i + 1, 0));
        wall(at(i + 1, last[1]), at(i, last[1]));
    }
    for j in 0..last[1] {
        wall(at(last[0], j), at(last[0], j + 1));
        wall(at(0, j + 1), at(0, j));
    }
    mesh
}

/// Half the extent of meshes along each axis.
pub(crate) fn extent(meshes: &[Mesh]) -> Vector {
    let all = together(meshes.iter().cloned());
    all.vertices
        .iter()
        .fold([0.0; 3], |most: Vector, v| [0, 1, 2].map(|axis| most[axis].max(v[axis].abs())))
}
