//! Iterative methods and corrections by `beamlet reconstruct`.

use crate::support::program::{beamlet, done, ended, run, workplace};
use beamlet::ndarray::Array3;
use ndarray_npy::{read_npy, write_npy};
use std::fs;
use std::path::Path;

const SCENE: &str = r#"
[source]
distance = "1.2 m"
spot = ["0 um", "0 um"]
energy = "30 keV"

[detector]
distance = "1.8 m"
pixels = [48, 1]
pitch = "150 um"

[scan]
angles = { from = "0 deg", to = "360 deg", count = 64 }
"#;

/// Chords of a disc of μ = 50 /m and radius 1 mm beside an axis `shift` columns from the middle.
fn sinograms(shift: f64) -> Array3<f32> {
    Array3::from_shape_fn((64, 1, 48), |(view, _, column)| {
        let angle = std::f64::consts::TAU * view as f64 / 64.0;
        let u = (column as f64 - 23.5) * 1e-4;
        let (across, depth) = (0.5e-3 * angle.cos() + shift * 1e-4, -0.5e-3 * angle.sin());
        let off = (across - u * (1.0 + depth / 1.2)) / (u / 1.2).hypot(1.0);
        (100.0 * (1e-6 - off * off).max(0.0).sqrt()) as f32
    })
}

#[test]
fn methods_write_their_residuals_and_corrections_are_recorded() {
    let directory = workplace(SCENE);
    let path = directory.path();
    write_npy(path.join("mu.npy"), &sinograms(1.3)).unwrap();
    let usual = "reconstruct mu.npy --geometry scene.toml --quantity mu --format npy --centre auto";
    for method in ["cgls", "sirt --non-negative", "bb"] {
        let words = format!("{usual} --method {method} --iterations 6 --overwrite -o volume");
        let printed = done(path, &words);
        let (_, axis) = printed.split_once("axis     in column ").unwrap();
        let column: f64 = axis.split_whitespace().next().unwrap().parse().unwrap();
        assert!((column - 24.8).abs() < 0.05, "{column}");
        let table = fs::read_to_string(path.join("volume/residuals.csv")).unwrap();
        let lines: Vec<&str> = table.lines().collect();
        assert_eq!((lines.len(), lines[0]), (8, "quantity,iteration,residual,taken"));
        assert_eq!(lines.iter().filter(|line| line.ends_with(",1")).count(), 1, "{table}");
        let volume: Array3<f32> = read_npy(path.join("volume/mu.npy")).unwrap();
        // At x = 0.5 mm, y = 0; six iterations of SIRT are 11 % short.
        let middle = volume[[0, 24, 28]];
        assert!((middle - 50.0).abs() < 8.0, "{method}: {middle}");
    }
    let record = fs::read_to_string(path.join("volume/volume.json")).unwrap();
    assert!(record.contains(r#""method": "bb""#) && record.contains(r#""iterations": 6"#));
    done(path, &format!("{usual} --rings --extrapolate -o filtered"));
    let record = fs::read_to_string(path.join("filtered/volume.json")).unwrap();
    assert!(record.contains(r#""rings": true"#) && record.contains(r#""extrapolate": true"#));
    assert!(!path.join("filtered/residuals.csv").exists());
}

fn volume(folder: &Path) -> Array3<f32> {
    read_npy(folder.join("mu.npy")).unwrap()
}

/// Residuals of residuals.csv.
fn residuals(folder: &Path) -> Vec<f64> {
    let table = fs::read_to_string(folder.join("residuals.csv")).unwrap();
    table.lines().skip(1).map(|line| line.split(',').nth(2).unwrap().parse().unwrap()).collect()
}

/// Root mean square of the difference to the disc of 50 /m about x = 0.5 mm.
fn error(volume: &Array3<f32>) -> f64 {
    let square = |((_, y, x), value): ((usize, usize, usize), &f32)| {
        let [x, y] = [x, y].map(|n| (n as f64 - 23.5) * 1e-4);
        let truth = if (x - 0.5e-3).hypot(y) < 1e-3 { 50.0 } else { 0.0 };
        (f64::from(*value) - truth).powi(2)
    };
    (volume.indexed_iter().map(square).sum::<f64>() / volume.len() as f64).sqrt()
}

#[test]
fn masks_starts_bounds_and_discrepancies_do_what_they_say() {
    let directory = workplace(SCENE);
    let path = directory.path();
    // Noise that a free reconstruction puts beside the disc.
    let mut noisy = sinograms(0.0);
    noisy.indexed_iter_mut().for_each(|((view, _, column), value)| {
        *value += if (7 * view + 13 * column) % 5 < 2 { 6e-3 } else { -4e-3 };
    });
    write_npy(path.join("mu.npy"), &noisy).unwrap();
    let usual = "reconstruct mu.npy --geometry scene.toml --quantity mu --format npy";
    let made = |name: &str, more: &str| {
        let printed = done(path, &format!("{usual} -o {name} {more}"));
        (volume(&path.join(name)), residuals(&path.join(name)), printed)
    };
    let (free, all, _) = made("free", "--method cgls --iterations 12");
    let shape = "cylinder:0.5mm,0mm,1.1mm";
    let (masked, _, printed) =
        made("masked", &format!("--method cgls --iterations 12 --mask {shape}"));
    assert!(printed.contains("mask     cylinder:0.0005 m,0 m,0.0011"), "{printed}");
    for ((_, y, x), value) in masked.indexed_iter() {
        let [x, y] = [x, y].map(|n| (n as f64 - 23.5) * 1e-4);
        assert!((x - 0.5e-3).hypot(y) <= 1.1e-3 || *value == 0.0, "{x} {y} {value}");
    }
    let [with, without] = [error(&masked), error(&free)];
    println!("measured error: {with:.3} with a mask, {without:.3} /m without");
    assert!(with < 0.95 * without, "{with} {without}");
    // The same voxels by a file of numpy's booleans.
    let inside = masked.mapv(|value| value != 0.0);
    write_npy(path.join("mask.npy"), &inside).unwrap();
    let (by_file, ..) = made("by_file", "--method cgls --iterations 12 --mask mask.npy");
    assert_eq!(by_file, masked);

    // A start goes on where another one ended.
    let (begun, rest, printed) = made("begun", "--method cgls --iterations 1 --start free");
    assert!(printed.contains("start    free"), "{printed}");
    assert!((rest[0] / all[all.len() - 1] - 1.0).abs() < 1e-3, "{rest:?} {all:?}");
    assert!(rest[1] <= rest[0] && rest[0] < 0.2 * all[0] && begun.iter().any(|v| *v > 40.0));

    let (kept, ended, _) =
        made("kept", "--method bb --iterations 60 --discrepancy 0.012 --non-negative");
    let (last, before) = ended.split_last().unwrap();
    assert!(*last <= 0.012 && before.iter().all(|it| *it > 0.012), "{ended:?}");
    assert!(kept.iter().all(|value| *value >= 0.0), "bounds");
}

#[test]
fn masks_in_another_order_and_torn_starts_are_refused() {
    let directory = workplace(SCENE);
    let path = directory.path();
    write_npy(path.join("mu.npy"), &sinograms(0.0)).unwrap();
    let usual = "reconstruct mu.npy --geometry scene.toml --quantity mu --format npy --method cgls --iterations 2";
    done(path, &format!("{usual} -o torn -q"));
    let mut torn = Array3::<f32>::ones((1, 48, 48));
    torn[[0, 3, 4]] = f32::NAN;
    write_npy(path.join("torn/mu.npy"), &torn).unwrap();
    let turned = Array3::<f32>::ones((48, 1, 48)).permuted_axes([1, 0, 2]);
    let turned = turned.as_standard_layout().into_owned().reversed_axes();
    write_npy(path.join("turned.npy"), &turned).unwrap();
    for (more, words) in
        [("--mask turned.npy", "[z][y][x]"), ("--start torn", "NaN in voxel x 4, y 3, z 0")]
    {
        let message = ended(&run(path, &format!("{usual} -o volume {more}")), 1);
        assert!(message.contains(words), "{more}: {message}");
    }
}

const TUBE: &str = r#"
[source]
distance = "1.2 m"
spot = ["0 um", "0 um"]
spectrum = { anode = "tungsten", kvp = "60 kV", filters = [{ material = "aluminium", thickness = "1 mm" }] }

[detector]
distance = "1.8 m"
pixels = [96, 1]
pitch = "1.5 mm"

[scan]
angles = { from = "0 deg", to = "360 deg", count = 180 }
"#;

/// A cylinder of 35 mm of water under 60 kVp: −ln T of the spectrum that the detector sees.
#[test]
fn beam_hardening_leaves_no_cupping_and_says_its_energy() {
    use beamlet::scene::{Beam, Scene};
    let directory = workplace(TUBE);
    let path = directory.path();
    let scene = Scene::load(path.join("scene.toml")).unwrap();
    let Beam::Spectrum(spec) = &scene.source.beam else { panic!("a spectrum") };
    let rows = beamlet::spectrum::Spectrum::after_filters(&scene, spec).unwrap();
    let seen = |energy: &f64| beamlet::spectrum::response(&scene, *energy).unwrap();
    let weights: Vec<f64> =
        rows.energies_kev.iter().zip(&rows.weights).map(|(e, weight)| weight * seen(e)).collect();
    let total: f64 = weights.iter().sum();
    let mean = rows.energies_kev.iter().zip(&weights).map(|(e, w)| e * w).sum::<f64>() / total;
    let of = |energies: &[f64]| -> Vec<f64> {
        let found = beamlet::material::constants_over(&scene, "water", energies).unwrap();
        found.iter().map(|it| it.mu).collect()
    };
    let mu = of(&rows.energies_kev);
    let sinograms = Array3::from_shape_fn((180, 1, 96), |(_, _, column)| {
        let u = (f64::from(column as u32) - 47.5) * 1e-3;
        let off = u / (u / 1.2).hypot(1.0);
        let length = 2.0 * (0.035_f64.powi(2) - off * off).max(0.0).sqrt();
        let term = |(weight, mu): (&f64, &f64)| weight * (-mu * length).exp();
        -(weights.iter().zip(&mu).map(term).sum::<f64>() / total).ln() as f32
    });
    write_npy(path.join("mu.npy"), &sinograms).unwrap();
    let usual = "reconstruct mu.npy --geometry scene.toml --quantity mu --format npy";
    let made = |name: &str, more: &str| {
        let printed = done(path, &format!("{usual} -o {name} {more}"));
        let volume = volume(&path.join(name));
        let mean = |near: f64, far: f64| {
            let inside: Vec<f64> = volume
                .indexed_iter()
                .filter(|((_, y, x), _)| {
                    let from = (*x as f64 - 47.5).hypot(*y as f64 - 47.5);
                    from >= near && from < far
                })
                .map(|(_, value)| f64::from(*value))
                .collect();
            inside.iter().sum::<f64>() / inside.len() as f64
        };
        ([mean(0.0, 8.0), mean(26.0, 30.0)], printed)
    };
    let ([middle, rim], printed) = made("plain", "");
    assert!(middle / rim < 0.98, "{middle} {rim}");
    let said = format!("means over the spectrum (mean detected energy {mean:.3} keV)");
    assert!(printed.contains(&said) && printed.contains("not corrected"), "{printed}");
    for (energy, words, more) in [
        (mean, format!("mu at {mean:.3} keV"), "--beam-hardening water"),
        (40.0, "mu at 40.000 keV".to_owned(), "--beam-hardening water@40keV"),
    ] {
        let ([middle, rim], printed) = made(&format!("at_{energy:.0}"), more);
        let truth = of(&[energy])[0];
        println!("measured cupping {:.1e}, level {:.1e}", middle / rim - 1.0, middle / truth - 1.0);
        assert!((middle / rim - 1.0).abs() < 0.005 && (middle / truth - 1.0).abs() < 0.005);
        assert!(printed.contains(&words), "{printed}");
    }
    let record = fs::read_to_string(path.join("at_40/volume.json")).unwrap();
    assert!(record.contains(r#""energy_kev": 40.0"#) && record.contains(r#""material": "water""#));
}

/// Refraction angles of a disc of δ = 1e-6 with a drift of 2 % of the largest and a column without a result.
#[test]
fn delta_is_made_of_integrated_angles_without_their_drift() {
    let directory = workplace(SCENE);
    let path = directory.path();
    let phase = |view: usize, u: f64| {
        let angle = std::f64::consts::TAU * view as f64 / 64.0;
        let (across, depth) = (0.5e-3 * angle.cos(), -0.5e-3 * angle.sin());
        let off = (across - u * (1.0 + depth / 1.2)) / (u / 1.2).hypot(1.0);
        2e-6 * (1e-6 - off * off).max(0.0).sqrt()
    };
    let angles = Array3::from_shape_fn((64, 1, 48), |(view, _, column)| {
        let u = (column as f64 - 23.5) * 1e-4;
        let slope = (phase(view, u - 5e-5) - phase(view, u + 5e-5)) / 1e-4;
        if column == 40 { f32::NAN } else { (slope + 1e-7) as f32 }
    });
    write_npy(path.join("angles.npy"), &angles).unwrap();
    let usual = "reconstruct angles.npy --geometry scene.toml --quantity delta --format npy";
    for method in ["cgls", "sirt --iterations 60", "bb"] {
        let words = format!("{usual} --phase --method {method} -o volume --overwrite");
        let printed = done(path, &words);
        let said = "phase    64 angles without a result are interpolated along the row";
        assert!(printed.contains(said) && printed.contains("rms 1.0"), "{printed}");
        let delta: Array3<f32> = read_npy(path.join("volume/delta.npy")).unwrap();
        let inside: Vec<f64> = delta
            .indexed_iter()
            .filter(|((_, y, x), _)| (*x as f64 - 28.5).hypot(*y as f64 - 23.5) < 7.0)
            .map(|(_, value)| f64::from(*value))
            .collect();
        let mean = inside.iter().sum::<f64>() / inside.len() as f64;
        println!("measured {method}: δ off by {:.1e}", mean / 1e-6 - 1.0);
        assert!((mean / 1e-6 - 1.0).abs() < 0.01, "{method}: {mean}");
    }
    let record = fs::read_to_string(path.join("volume/volume.json")).unwrap();
    assert!(record.contains("\"rms_rad\": 1.0") && record.contains("\"filled\": 64"), "{record}");
}

#[test]
fn dry_runs_of_iterations_say_memory_and_time_within_a_limit() {
    let directory = workplace(SCENE);
    let path = directory.path();
    write_npy(path.join("mu.npy"), &sinograms(0.0)).unwrap();
    let usual =
        "reconstruct mu.npy --geometry scene.toml --quantity mu -o volume --dry-run --method";
    for method in ["cgls", "sirt", "bb"] {
        let printed = done(path, &format!("{usual} {method} --iterations 7 --voxel 20um"));
        for words in ["MiB on the host", "s of projections and back-projections, 7 iterations"] {
            assert!(printed.contains(words), "{method}: {printed}");
        }
    }
    let refused = format!("{usual} cgls --size 4096,4096,1 --voxel 1um --memory-limit 300MiB");
    let message = ended(&run(path, &refused), 1);
    assert!(message.contains("raise the memory limit"), "{message}");
    assert!(!path.join("volume").exists());
}

/// The peak resident set of the program, its driver and the device on the host stays within the limit.
#[cfg(target_os = "linux")]
#[test]
fn a_memory_limit_is_held_and_changes_no_value() {
    let scene = SCENE.replace("[48, 1]", "[200, 40]").replace("count = 64", "count = 32");
    let directory = workplace(&scene);
    let path = directory.path();
    let one = sinograms(0.0);
    let wide = Array3::from_shape_fn((32, 40, 200), |(view, row, column)| {
        let inside = (76..124).contains(&column);
        let value = if inside { one[[2 * view, 0, column - 76]] } else { 0.0 };
        value * (1.0 + row as f32 / 80.0)
    });
    write_npy(path.join("mu.npy"), &wide).unwrap();
    // 8 MiB a volume, beside sinograms of 1 MiB.
    let usual = "mu.npy --geometry scene.toml --quantity mu --format npy --size 128,128,128";
    let taken = |name: &str, more: &str| {
        let words = format!("reconstruct {usual} -o {name} -q {more}");
        // The validation layer takes memory of its own, and threads do.
        let mut child = beamlet(path)
            .args(words.split_whitespace())
            .env_remove("VK_INSTANCE_LAYERS")
            .env("RAYON_NUM_THREADS", "2")
            .env("LP_NUM_THREADS", "2")
            .spawn()
            .unwrap();
        let status = format!("/proc/{}/status", child.id());
        let mut peak = 0;
        loop {
            // The kernel keeps the peak; the last look before the end has it.
            let text = fs::read_to_string(&status).unwrap_or_default();
            let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
            let kibibytes = line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok());
            peak = kibibytes.map_or(peak, |kibibytes: u64| kibibytes >> 10);
            if let Some(ended) = child.try_wait().unwrap() {
                assert!(ended.success(), "{words}");
                return peak;
            }
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
    };
    for (method, limit) in [("fbp", 160_u64), ("cgls --iterations 1", 210)] {
        let name = method.split(' ').next().unwrap();
        let free = taken(name, &format!("--method {method}"));
        let within = taken(
            &format!("{name}_within"),
            &format!("--method {method} --memory-limit {limit}MiB"),
        );
        println!("measured {method}: {within} MiB of {limit}, {free} without a limit");
        assert!(within <= limit, "{method}: {within} MiB");
        assert_eq!(volume(&path.join(name)), volume(&path.join(format!("{name}_within"))));
    }
    for (method, limit) in [("fbp", 124), ("cgls", 164)] {
        let words =
            format!("reconstruct {usual} -o none --method {method} --memory-limit {limit}MiB");
        let message = ended(&run(path, &words), 1);
        assert!(message.contains(&format!("{limit} MiB are available")), "{message}");
        assert!(!path.join("none").exists());
    }
}
