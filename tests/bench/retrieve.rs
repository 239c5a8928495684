//! Fits of 11-point curves per second, on the device, and beside a loop of scipy over pixels on
//! the same curves: `cargo bench --bench retrieve`. `BEAMLET_PYTHON` names a Python with scipy.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a benchmark stops at the first fault")]
#![allow(clippy::cast_possible_truncation, reason = "curves are f32")]
#![allow(clippy::print_stdout, reason = "a table is the result")]

use beamlet::Cancel;
use beamlet::internals::retrieve::{BackgroundTerm, Fitter, ValueNoise};
use beamlet::retrieve::Weights;
use beamlet::{Engine, EngineOptions};
use ndarray::{Array2, s};
use std::fs;
use std::process::Command;
use std::time::{Duration, Instant};

const CURVES: usize = 1 << 20;
const STEPS: usize = 11;
/// Curves that scipy gets.
const FOR_SCIPY: usize = 2000;
const ATTEMPTS: usize = 3;

fn main() {
    let offsets: Vec<f64> = (0..STEPS).map(|i| -25e-6 + 5e-6 * i as f64).collect();
    let curves = curves(&offsets);
    let engine = Engine::open(&EngineOptions::default()).expect("a Vulkan device");
    println!("{} curves of {STEPS} points on {}", CURVES, engine.description().name);
    println!("{:10}{:>24}{:>30}", "weights", "million fits / s", "million fits / processor s");
    let mut best = [0.0; 2];
    for weights in [Weights::None, Weights::Poisson] {
        let noise = ValueNoise { weights, ..ValueNoise::default() };
        let fitter = Fitter::new(&engine, &offsets, noise, BackgroundTerm::Free).unwrap();
        fitter.fit(curves.slice(s![.., ..4096]), &Cancel::default()).unwrap();
        let mut rates = [0.0_f64; 2];
        for _ in 0..ATTEMPTS {
            let (began, before) = (Instant::now(), processor_time());
            let fits = fitter.fit(curves.view(), &Cancel::default()).unwrap();
            let (wall, cpu) = (began.elapsed(), processor_time() - before);
            assert!(fits.iter().filter(|fit| fit.flags == 0).count() * 100 > 99 * CURVES);
            let rate = |time: Duration| CURVES as f64 / 1e6 / time.as_secs_f64();
            rates = [rates[0].max(rate(wall)), rates[1].max(rate(cpu))];
        }
        let name = if weights == Weights::None { "none" } else { "poisson" };
        println!("{name:10}{:>24.3}{:>30.3}", rates[0], rates[1]);
        if weights == Weights::None {
            best = rates;
        }
    }
    match scipy(&curves) {
        Some([wall, cpu]) => println!(
            "scipy's curve_fit per pixel: {wall:.6} million fits / s, {cpu:.6} / processor s; \
             ratio {:.0} by time, {:.0} by processor time",
            best[0] / wall,
            best[1] / cpu
        ),
        None => println!("no Python with scipy: set BEAMLET_PYTHON for the ratio"),
    }
}

/// Eq. 1 with noise of about 1000 counts at the peak, from a fixed sequence.
fn curves(offsets: &[f64]) -> Array2<f32> {
    let mut state = 1_u64;
    let mut uniform = move || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / f64::from(1_u32 << 24)
    };
    let mut all = Array2::zeros((offsets.len(), CURVES));
    for mut curve in all.columns_mut() {
        let peak = 1000.0 * (0.5 + 0.5 * uniform());
        let centre = (uniform() - 0.5) * 10e-6;
        let width = (8.5 + uniform()) * 1e-6;
        for (y, x) in curve.iter_mut().zip(offsets) {
            let clean = peak * (-0.5 * ((x - centre) / width).powi(2)).exp() + 20.0;
            let noise = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
            *y = (clean + clean.sqrt() * noise).round() as f32;
        }
    }
    all
}

/// Million fits a second of scipy, by time and by processor time.
fn scipy(curves: &Array2<f32>) -> Option<[f64; 2]> {
    let python = std::env::var("BEAMLET_PYTHON").unwrap_or_else(|_| "python3".into());
    let file = tempfile::Builder::new().suffix(".npy").tempfile().unwrap();
    ndarray_npy::write_npy(file.path(), &curves.slice(s![.., ..FOR_SCIPY]).to_owned()).unwrap();
    let output = Command::new(python)
        .args(["tests/peers/scipy_fit.py".as_ref(), file.path().as_os_str()])
        .output()
        .ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    let mut numbers = text.split_whitespace().map(|word| word.parse::<f64>().unwrap() / 1e6);
    Some([numbers.next()?, numbers.next()?])
}

/// Processor time of this process, all threads.
fn processor_time() -> Duration {
    let stat = fs::read_to_string("/proc/self/stat").expect("Linux");
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap().split_whitespace().collect();
    // User and system time in clock ticks of 10 ms.
    let ticks: u64 = fields[11].parse::<u64>().unwrap() + fields[12].parse::<u64>().unwrap();
    Duration::from_millis(10 * ticks)
}
