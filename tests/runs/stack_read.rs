//! Reading stacks: every format and sample type to the same values, and what is refused.

use beamlet::stack::{OpenRun, StackFile};
use ndarray::{Array, Array2, Array3, Array4, Dimension, s};
use ndarray_npy::{WritableElement, write_npy};
use std::fs::{self, File};
use std::path::Path;
use tiff::encoder::colortype::{ColorType, Gray8, Gray16, Gray32, Gray32Float, Gray64Float, RGB8};
use tiff::encoder::{TiffEncoder, TiffValue};

const SHAPE: [usize; 4] = [2, 3, 5, 7];

/// Values that every sample type holds.
fn values() -> Array4<f32> {
    Array4::from_shape_fn(SHAPE, |(v, s, r, c)| (v * 100 + s * 40 + r * 7 + c) as f32)
}

fn read(stack: &StackFile) -> Array4<f32> {
    let mut all = Array4::zeros(stack.shape());
    for (view, mut to) in all.outer_iter_mut().enumerate() {
        to.assign(&stack.view(view).unwrap());
    }
    all
}

fn npy<T: WritableElement, D: Dimension>(path: &Path, array: &Array<T, D>) -> StackFile {
    write_npy(path, array).unwrap();
    StackFile::open(path).unwrap()
}

fn tiff_pages<C: ColorType>(path: &Path, big: bool, value: impl Fn(f32) -> C::Inner)
where
    [C::Inner]: TiffValue,
{
    let file = File::create(path).unwrap();
    if big {
        pages::<C, _>(TiffEncoder::new_big(file).unwrap(), value);
    } else {
        pages::<C, _>(TiffEncoder::new(file).unwrap(), value);
    }
}

fn pages<C: ColorType, K: tiff::encoder::TiffKind>(
    mut encoder: TiffEncoder<File, K>,
    value: impl Fn(f32) -> C::Inner,
) where
    [C::Inner]: TiffValue,
{
    for frame in values().into_shape_with_order((6, 5, 7)).unwrap().outer_iter() {
        let samples: Vec<C::Inner> = frame.iter().map(|v| value(*v)).collect();
        let mut image = encoder.new_image::<C>(7, 5).unwrap();
        image.rows_per_strip(2).unwrap();
        image.write_data(&samples).unwrap();
    }
}

fn exr_frame(path: &Path, frame: &Array2<f32>) {
    use exr::prelude::*;
    let (rows, columns) = frame.dim();
    let channels = SpecificChannels::build()
        .with_channel("Y")
        .with_pixel_fn(|at: Vec2<usize>| (frame[[at.y(), at.x()]],));
    Image::from_channels((columns, rows), channels).write().to_file(path).unwrap();
}

fn refusal(path: &Path) -> String {
    StackFile::open(path).unwrap_err().to_string()
}

#[test]
fn npy_of_every_sample_type_reads_to_the_same_values() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npy");
    assert_eq!(read(&npy(&path, &values())), values());
    assert_eq!(read(&npy(&path, &values().mapv(f64::from))), values());
    let bytes = values().mapv(|v| (v % 251.0) as u8);
    assert_eq!(read(&npy(&path, &bytes)), bytes.mapv(f32::from));
    assert_eq!(read(&npy(&path, &values().mapv(|v| v as u16))), values());
    assert_eq!(read(&npy(&path, &values().mapv(|v| v as u32))), values());
    let stack = npy(&path, &values().slice_move(s![1, .., .., ..]));
    assert_eq!(stack.shape(), [1, 3, 5, 7]);
    assert_eq!(stack.rows(0, 1..4).unwrap(), values().slice_move(s![1, .., 1..4, ..]));
    assert_eq!(npy(&path, &values().slice_move(s![1, 2, .., ..])).shape(), [1, 1, 5, 7]);
}

#[test]
fn arrays_behind_one_another_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npy");
    npy(&path, &values());
    let one = fs::read(&path).unwrap();
    fs::write(&path, [one.as_slice(), &one].concat()).unwrap();
    assert!(refusal(&path).contains("arrays one behind another"), "{}", refusal(&path));
    // Padding is no array.
    fs::write(&path, [one.as_slice(), &[0; 64]].concat()).unwrap();
    assert_eq!(read(&StackFile::open(&path).unwrap()), values());
}

#[test]
fn big_endian_npy_reads_to_the_same_values() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npy");
    npy(&path, &values().mapv(|v| v as u16));
    let mut bytes = fs::read(&path).unwrap();
    let start = bytes.len() - 2 * values().len();
    let at = bytes.windows(3).position(|word| word == b"<u2").unwrap();
    bytes[at] = b'>';
    bytes[start..].chunks_exact_mut(2).for_each(<[u8]>::reverse);
    fs::write(&path, bytes).unwrap();
    assert_eq!(read(&StackFile::open(&path).unwrap()), values());
}

#[test]
fn tiff_pages_of_every_sample_type_read_to_the_same_values() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let check = || {
        let stack = StackFile::open(&path).unwrap();
        assert_eq!(stack.shape(), [1, 6, 5, 7]);
        let stack = stack.with_steps(3).unwrap();
        assert_eq!(read(&stack), values());
        assert_eq!(stack.rows(1, 3..5).unwrap(), values().slice_move(s![1, .., 3..5, ..]));
        assert!(stack.with_steps(6).is_err());
    };
    for big in [false, true] {
        tiff_pages::<Gray32Float>(&path, big, |v| v);
        check();
        tiff_pages::<Gray64Float>(&path, big, f64::from);
        check();
        tiff_pages::<Gray16>(&path, big, |v| v as u16);
        check();
        tiff_pages::<Gray32>(&path, big, |v| v as u32);
        check();
    }
    tiff_pages::<Gray8>(&path, false, |v| (v % 251.0) as u8);
    let stack = StackFile::open(&path).unwrap().with_steps(3).unwrap();
    assert_eq!(read(&stack), values().mapv(|v| v % 251.0));
}

#[test]
fn folders_of_frames_are_read_in_the_order_of_their_numbers() {
    let folder = tempfile::tempdir().unwrap();
    for view in 0..2 {
        let place = folder.path().join(format!("view_{view}"));
        fs::create_dir(&place).unwrap();
        for step in 0..3 {
            // 8, 9, 10: by letters, 10 would come first.
            let frame = values().slice_move(s![view, step, .., ..]);
            exr_frame(&place.join(format!("step_{}.exr", step + 8)), &frame);
        }
    }
    fs::write(folder.path().join("notes.txt"), "mine").unwrap();
    let stack = StackFile::open(folder.path()).unwrap();
    assert_eq!(read(&stack), values());
    assert_eq!(stack.rows(1, 2..3).unwrap(), values().slice_move(s![1, .., 2..3, ..]));
    assert!(stack.rows(1, 2..6).is_err() && stack.rows(2, 0..1).is_err());
}

#[test]
fn a_frame_that_is_missing_or_of_another_shape_is_named() {
    let folder = tempfile::tempdir().unwrap();
    for step in [0, 1, 3, 4] {
        exr_frame(&folder.path().join(format!("f{step:03}.exr")), &Array2::zeros((2, 3)));
    }
    let message = refusal(folder.path());
    assert!(message.contains("f001.exr") && message.contains("2 is missing"), "{message}");
    exr_frame(&folder.path().join("f002.exr"), &Array2::zeros((3, 2)));
    let message = StackFile::open(folder.path()).unwrap().view(0).unwrap_err().to_string();
    assert!(message.contains("f002.exr") && message.contains("3 rows"), "{message}");
    exr_frame(&folder.path().join("f002.exr"), &Array2::zeros((2, 3)));
    assert!(StackFile::open(folder.path()).unwrap().view(0).is_ok());
}

#[test]
fn parts_of_an_exr_are_refused_with_their_number() {
    use exr::prelude::*;
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("frame.exr");
    let layer = |name: &str| {
        let channel = AnyChannel::new("Y", FlatSamples::F32(vec![1.0; 16]));
        let channels = AnyChannels::sort([channel].into_iter().collect());
        Layer::new((4, 4), LayerAttributes::named(name), Encoding::UNCOMPRESSED, channels)
    };
    let attributes = ImageAttributes::new(IntegerBounds::from_dimensions((4, 4)));
    let image = Image::from_layers(attributes, vec![layer("left"), layer("right")]);
    image.write().to_file(&path).unwrap();
    let message = refusal(&path);
    assert!(message.contains("has 2 parts; allowed: one"), "{message}");
}

/// f32 holds whole numbers to 2^24.
#[test]
fn whole_numbers_of_32_bits_are_compared_as_they_are() {
    let directory = tempfile::tempdir().unwrap();
    let paths = ["a.npy", "b.npy"].map(|name| directory.path().join(name));
    for (path, value) in paths.iter().zip([1_u32 << 24, (1 << 24) + 1]) {
        write_npy(path, &Array3::from_elem((1, 2, 2), value)).unwrap();
    }
    let mut control = beamlet::RowsControl::default();
    let found = beamlet::compare::compare(&paths[0], &paths[1], None, &mut control).unwrap();
    assert!((found[0].largest - 1.0).abs() < 1e-12 && !found[0].within(0.5), "{found:?}");
}

#[test]
fn a_compression_that_loses_precision_is_refused() {
    use exr::prelude::*;
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("frame.exr");
    let channel = AnyChannel::new("Y", FlatSamples::F32(vec![1.0; 16]));
    let channels = AnyChannels::sort([channel].into_iter().collect());
    let encoding = Encoding { compression: Compression::B44, ..Encoding::UNCOMPRESSED };
    let layer = Layer::new((4, 4), LayerAttributes::default(), encoding, channels);
    Image::from_layer(layer).write().to_file(&path).unwrap();
    let message = refusal(&path);
    assert!(message.contains("B44; allowed: none, RLE, ZIP, PIZ, PXR24"), "{message}");
}

#[test]
fn what_is_no_stack_is_refused_with_what_was_found() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npy");
    write_npy(&path, &values().mapv(|v| v as i64)).unwrap();
    assert!(refusal(&path).contains("i8") && refusal(&path).contains("allowed"));
    write_npy(&path, &Array3::<f32>::zeros((4, 3, 2)).reversed_axes()).unwrap();
    assert!(refusal(&path).contains("Fortran"), "{}", refusal(&path));
    write_npy(&path, &ndarray::Array1::<f32>::zeros(4)).unwrap();
    assert!(refusal(&path).contains("[4]"), "{}", refusal(&path));
    write_npy(&path, &Array3::<f32>::zeros((0, 3, 2))).unwrap();
    assert!(refusal(&path).contains("nothing"), "{}", refusal(&path));
    npy(&path, &values());
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
    assert!(refusal(&path).contains("cut short"), "{}", refusal(&path));
    // Brackets without end, as a hostile header may have them.
    let deep = [b"\x93NUMPY\x01\x00\x60\xea".as_slice(), &[b'('; 60_000]].concat();
    fs::write(&path, deep).unwrap();
    assert!(refusal(&path).len() < 500 && refusal(&path).contains("header"));
    fs::write(&path, "nonsense").unwrap();
    assert!(refusal(&path).contains("header"), "{}", refusal(&path));

    let path = folder.path().join("a.tif");
    let mut encoder = TiffEncoder::new(File::create(&path).unwrap()).unwrap();
    encoder.write_image::<RGB8>(2, 2, &[0; 12]).unwrap();
    drop(encoder);
    assert!(refusal(&path).contains("RGB"), "{}", refusal(&path));
    tiff_pages::<Gray16>(&path, false, |v| v as u16);
    let bytes = fs::read(&path).unwrap();
    for cut in [3, bytes.len() / 2, bytes.len() - 4] {
        fs::write(&path, &bytes[..cut]).unwrap();
        let read = StackFile::open(&path).and_then(|stack| stack.view(0));
        assert!(read.is_err(), "{cut} of {} bytes", bytes.len());
    }

    // A page that claims 4 billion columns: refused before memory is taken for it.
    let wide = bytes.windows(12).position(|w| w[..8] == [0, 1, 4, 0, 1, 0, 0, 0]);
    let mut hollow = bytes.clone();
    let at = wide.expect("the tag of the width");
    hollow[at + 8..at + 12].copy_from_slice(&[0xff; 4]);
    fs::write(&path, hollow).unwrap();
    assert!(refusal(&path).contains("claims"), "{}", refusal(&path));

    let path = folder.path().join("a.exr");
    exr_frame(&path, &Array2::zeros((40, 30)));
    let bytes = fs::read(&path).unwrap();
    for cut in [3, bytes.len() / 2, bytes.len() - 4] {
        fs::write(&path, &bytes[..cut]).unwrap();
        let read = StackFile::open(&path).and_then(|stack| stack.view(0));
        assert!(read.is_err(), "{cut} of {} bytes", bytes.len());
    }
    assert!(refusal(&folder.path().join("none.npy")).contains("cannot be read"));
    assert!(refusal(folder.path()).contains("allowed: one format"));
    assert!(OpenRun::open(folder.path()).unwrap_err().to_string().contains("run.json"));
}
