//! TIFF stacks of runs: what other readers find in them, and what a run does with them.

use crate::support::program::{Workplace, ended};
use beamlet::stack::StackFile;
use std::fs::File;
use std::io::BufReader;
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult};
use tiff::tags::Tag;

/// Two views, three steps; counts of 12 bits.
const SCENE: &str = r#"
source = { distance = "1.21 m", spot = "30 um", energy = "30 keV" }
sample_mask = { distance = "1.2 m", transmission = 0.0, projected_aperture = "30 um" }
detector_mask = { transmission = 0.0, projected_aperture = "30 um" }
scan = { mask_offsets = { start = "-10 um", stop = "10 um", step = "10 um" }, angles = ["0 deg", "20 deg"] }
[detector]
distance = "1.8 m"
pixels = [12, 5]
pitch = ["150 um", "75.5 um"]
photons = 500
offset = 100
electronic_noise = 3
bit_depth = 12
[[object]]
name = "rod"
shape = { cylinder = { radius = "0.3 mm", height = "16 mm" } }
material = "PMMA"
"#;

fn run(format: &str) -> Workplace {
    let place = Workplace::new(SCENE);
    ended(&place.simulate(&["--format", format]), 0);
    place
}

/// Every page of a file by the decoder alone, its description and its resolution along x and z.
fn pages(place: &Workplace, name: &str) -> (Vec<DecodingResult>, String, [f64; 2]) {
    let file = BufReader::new(File::open(place.path("run").join(name)).unwrap());
    let mut decoder = Decoder::new(file).unwrap();
    let text = decoder.get_tag_ascii_string(Tag::ImageDescription).unwrap();
    let fraction = |tag: Tag, decoder: &mut Decoder<_>| {
        let parts = decoder.get_tag_u32_vec(tag).unwrap();
        f64::from(parts[0]) / f64::from(parts[1])
    };
    let resolution = [Tag::XResolution, Tag::YResolution].map(|tag| fraction(tag, &mut decoder));
    let mut pages = Vec::new();
    loop {
        assert_eq!(decoder.dimensions().unwrap(), (12, 5));
        pages.push(decoder.read_image().unwrap());
        if !decoder.more_images() {
            break;
        }
        decoder.next_image().unwrap();
    }
    (pages, text, resolution)
}

#[test]
fn stacks_are_calibrated_for_imagej_and_counts_have_16_bits() {
    let place = run("tiff");
    let (sample, text, resolution) = pages(&place, "sample.tif");
    assert!(text.starts_with("ImageJ="), "{text}");
    for line in ["images=6", "slices=3", "frames=2", "hyperstack=true", "unit=um"] {
        assert!(text.lines().any(|found| found == line), "{line} in {text}");
    }
    let pixels = resolution.map(|per_micrometre| 1.0 / per_micrometre);
    assert!((pixels[0] - 150.0).abs() < 1e-6 && (pixels[1] - 75.5).abs() < 1e-6, "{pixels:?}");
    assert_eq!(sample.len(), 6);
    assert!(sample.iter().all(|page| matches!(page, DecodingResult::F32(_))));
    let (flat, text, _) = pages(&place, "flat.tif");
    assert!(text.contains("slices=3") && !text.contains("frames="), "{text}");
    assert_eq!(flat.len(), 3);

    // The values are those of the run in NPY, the counts as whole numbers.
    let other = run("npy");
    for (name, pages) in [
        ("sample", sample),
        ("counts/sample", pages(&place, "counts/sample.tif").0),
        ("dark", pages(&place, "dark.tif").0),
    ] {
        let stack = StackFile::open(other.path("run").join(format!("{name}.npy"))).unwrap();
        let [views, steps, ..] = stack.shape();
        assert_eq!(pages.len(), views * steps, "{name}");
        for (index, page) in pages.into_iter().enumerate() {
            let wanted = stack.frame(index / steps, index % steps, 0..5).unwrap();
            let found: Vec<f32> = match page {
                DecodingResult::F32(values) if name == "sample" => values,
                DecodingResult::U16(values) if name != "sample" => {
                    values.into_iter().map(f32::from).collect()
                }
                _ => panic!("{name}: samples of another type"),
            };
            assert_eq!(found, wanted.iter().copied().collect::<Vec<_>>(), "{name}, page {index}");
        }
    }
    // So says compare, and the logs have the same checksums.
    let paths = [&other, &place].map(|place| place.path("run").display().to_string());
    ended(&place.beamlet(&["compare", &paths[0], &paths[1]]), 0);
    assert_eq!(checksums(&place), checksums(&other));
    ended(&place.beamlet(&["check", "run"]), 0);
    ended(&place.beamlet(&["retrieve", "run", "-q", "--counts", "--method", "three-step"]), 0);
}

/// progress.log without the counts of rays.
fn checksums(place: &Workplace) -> Vec<String> {
    let log = String::from_utf8(place.bytes("progress.log")).unwrap();
    log.lines().map(|line| line.split(" tally:").next().unwrap().to_owned()).collect()
}

#[test]
fn a_damaged_stack_is_told_and_made_again_and_files_of_others_stay() {
    let place = run("tiff");
    let whole = ["sample.tif", "counts/sample.tif", "flat.tif"].map(|name| place.bytes(name));
    let mut damaged = whole[1].clone();
    let last = damaged.len() - 3;
    damaged[last] ^= 1;
    place.write("counts/sample.tif", &damaged);
    let message = ended(&place.beamlet(&["check", "run"]), 1);
    assert!(message.contains("sample/1"), "{message}");
    // A header that is not the one that was written is mended, too.
    let mut header = whole[2].clone();
    header[9] ^= 1;
    place.write("flat.tif", &header);
    let message = ended(&place.simulate(&["--resume"]), 0);
    assert!(message.contains("flat.tif") && message.contains("repaired"), "{message}");
    let again = ["sample.tif", "counts/sample.tif", "flat.tif"].map(|name| place.bytes(name));
    assert!(whole == again);

    place.write("notes.tif", b"mine");
    let message = ended(&place.simulate(&["--format", "tiff"]), 1);
    assert!(message.contains("holds a run already"), "{message}");
    ended(&place.simulate(&["--format", "npy", "--overwrite"]), 0);
    assert!(!place.path("run/sample.tif").exists() && !place.path("run/counts/flat.tif").exists());
    assert_eq!(place.bytes("notes.tif"), b"mine");
}

#[test]
fn signed_whole_numbers_are_read() {
    let place = tempfile::tempdir().unwrap();
    let values: Vec<i16> = vec![-300, 0, 7, 32767, -32768, 1];
    for (bits, name) in [(16, "a.tif"), (32, "b.tif")] {
        let path = place.path().join(name);
        let mut encoder = tiff::encoder::TiffEncoder::new(File::create(&path).unwrap()).unwrap();
        if bits == 16 {
            encoder.write_image::<tiff::encoder::colortype::GrayI16>(3, 2, &values).unwrap();
        } else {
            let wide: Vec<i32> = values.iter().map(|value| i32::from(*value) * 1000).collect();
            encoder.write_image::<tiff::encoder::colortype::GrayI32>(3, 2, &wide).unwrap();
        }
        let mut decoder = Decoder::new(BufReader::new(File::open(&path).unwrap())).unwrap();
        assert_eq!(decoder.colortype().unwrap(), ColorType::Gray(bits));
        let read = StackFile::open(&path).unwrap().frame(0, 0, 0..2).unwrap();
        let scale = if bits == 16 { 1.0 } else { 1000.0 };
        let wanted: Vec<f32> = values.iter().map(|value| f32::from(*value) * scale).collect();
        assert_eq!(read.iter().copied().collect::<Vec<_>>(), wanted);
        let npy = path.with_extension("npy");
        ndarray_npy::write_npy(
            &npy,
            &ndarray::Array2::from_shape_vec((2, 3), values.clone()).unwrap(),
        )
        .unwrap();
        let read = StackFile::open(&npy).unwrap().frame(0, 0, 0..2).unwrap();
        assert!((read[[0, 0]] + 300.0).abs() <= 0.0);
    }
}
