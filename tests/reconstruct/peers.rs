//! Files and figures for tests/peers/astra.sh: the fan of the paper, with a body and rods.

use crate::set_up::views_over_a_turn;
use crate::support;
use beamlet::ndarray::Array3;
use beamlet::reconstruct::{
    Data, IterativeOptions, Measured, Model, ScanGeometry, VolumeGrid, iterate,
};
use beamlet::{Backend, RowsControl};
use std::fmt::Write as _;
use std::path::Path;

const SIDE: usize = 256;

/// Centre and radius, m, and value of discs, which add up.
const DISCS: [([f64; 2], f64, f64); 5] = [
    ([0.4e-3, -0.3e-3], 9.0e-3, 1.0),
    ([4.0e-3, 1.0e-3], 1.5e-3, 0.8),
    ([-3.0e-3, 4.0e-3], 1.0e-3, -0.6),
    ([-4.5e-3, -3.0e-3], 0.5e-3, 1.2),
    ([1.0e-3, -6.0e-3], 0.3e-3, 2.0),
];

/// User and system time of this process, s.
fn cpu() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap();
    let fields: Vec<&str> = stat.rsplit_once(')').unwrap().1.split_whitespace().collect();
    (fields[11].parse::<f64>().unwrap() + fields[12].parse::<f64>().unwrap()) / 100.0
}

/// Means over 6 × 6 places in a voxel, or over 6 lines in a column.
fn parts(pitch: f64) -> [f64; 6] {
    [0, 1, 2, 3, 4, 5].map(|n| (f64::from(n) - 2.5) / 6.0 * pitch)
}

fn sinogram(geometry: &ScanGeometry) -> Array3<f32> {
    let [near, far] = [geometry.source_distance, geometry.detector_distance];
    Array3::from_shape_fn((geometry.angles.len(), 1, SIDE), |(view, _, column)| {
        let (sin, cos) = geometry.angles[view].sin_cos();
        let line = |u: f64| -> f64 {
            let chord = |([x, y], radius, value): &([f64; 2], f64, f64)| {
                let [across, depth] = [x * cos + y * sin, y * cos - x * sin];
                let off = (across * far - (depth + near) * u) / u.hypot(far);
                value * 2.0 * (radius * radius - off * off).max(0.0).sqrt()
            };
            DISCS.iter().map(chord).sum()
        };
        (parts(150e-6).map(|part| line(geometry.columns[column] + part)).iter().sum::<f64>() / 6.0)
            as f32
    })
}

fn truth(grid: &VolumeGrid) -> Array3<f32> {
    Array3::from_shape_fn((1, SIDE, SIDE), |(_, y, x)| {
        let [x, y] =
            [(x, 0), (y, 1)].map(|(n, axis)| grid.origin[axis] + grid.voxel[axis] * n as f64);
        let at = |x: f64, y: f64| -> f64 {
            let inside = |(centre, radius, _): &&([f64; 2], f64, f64)| {
                (x - centre[0]).hypot(y - centre[1]) < *radius
            };
            DISCS.iter().filter(inside).map(|disc| disc.2).sum()
        };
        let side = parts(grid.voxel[0]);
        let sum: f64 = side.iter().flat_map(|a| side.map(|b| at(x + a, y + b))).sum();
        (sum / 36.0) as f32
    })
}

/// Root mean square of the error within 8.5 mm of the axis.
fn error(values: &Array3<f32>, truth: &Array3<f32>, grid: &VolumeGrid) -> f64 {
    let inside = |(_, y, x): (usize, usize, usize)| {
        let place = |n: usize, axis: usize| grid.origin[axis] + grid.voxel[axis] * n as f64;
        place(x, 0).hypot(place(y, 1)) < 8.5e-3
    };
    let squares: Vec<f64> = values
        .indexed_iter()
        .filter(|(at, _)| inside(*at))
        .map(|(at, value)| f64::from(value - truth[at]).powi(2))
        .collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

fn write(path: &Path, values: &Array3<f32>) {
    let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    std::fs::write(path, bytes).unwrap();
}

#[test]
#[ignore = "for tests/peers/astra.sh"]
fn files_for_astra() {
    let folder = std::env::var_os("BEAMLET_PEERS").expect("a folder");
    let folder = Path::new(&folder);
    let columns = crate::set_up::places(256, 150e-6);
    let scan = |count| {
        ScanGeometry::new([1.213, 1.8], columns.clone(), vec![0.0], views_over_a_turn(count))
    };
    let geometry = scan(180);
    let grid = VolumeGrid::of(&geometry).unwrap();
    let (sinogram, truth) = (sinogram(&geometry), truth(&grid));
    write(&folder.join("sinogram.f32"), &sinogram);
    write(&folder.join("truth.f32"), &truth);
    let (engine, control) = (support::engine(Backend::Bvh), &mut RowsControl::default());
    let mut figures = String::from("figure,value\n");
    writeln!(figures, "voxel,{}", grid.voxel[0]).unwrap();
    for iterations in [5, 10, 20] {
        let options = IterativeOptions::default().with_iterations(iterations);
        let measured = Measured::new(Data::Attenuation, sinogram.view());
        let made = iterate(&engine, &geometry, &measured, &grid, &options, control).unwrap();
        let error = error(&made.volume.values, &truth, &grid);
        writeln!(figures, "rmse_{iterations},{error}").unwrap();
    }
    let geometry = scan(360);
    let model = Model::new(&engine, &geometry, &grid, Data::Attenuation, None).unwrap();
    let once = model.project(truth.view(), control).unwrap();
    model.transpose(once.view(), control).unwrap();
    for name in ["forward", "back"] {
        let before = cpu();
        for _ in 0..10 {
            if name == "forward" {
                model.project(truth.view(), control).unwrap();
            } else {
                model.transpose(once.view(), control).unwrap();
            }
        }
        writeln!(figures, "{name},{}", (cpu() - before) / 10.0).unwrap();
    }
    println!("{figures}");
    std::fs::write(folder.join("beamlet.csv"), figures).unwrap();
}
