//! TIFF pages of other programs: samples whose white is zero, and pages that are no frames.

use beamlet::stack::StackFile;
use ndarray::{Array3, s};
use std::fs::{self, File};
use std::path::Path;
use tiff::encoder::colortype::{ColorType, Gray8, Gray16, Gray32, Gray32Float, Gray64Float, RGB8};
use tiff::encoder::{TiffEncoder, TiffKind, TiffValue};
use tiff::tags::Tag;

const SIDES: [usize; 3] = [3, 5, 7];

fn values() -> Array3<f32> {
    Array3::from_shape_fn(SIDES, |(page, row, column)| {
        f32::from(u8::try_from(page * 40 + row * 7 + column).unwrap())
    })
}

/// A page with this `NewSubfileType`.
fn page<C: ColorType, K: TiffKind>(
    encoder: &mut TiffEncoder<File, K>,
    [rows, columns]: [u32; 2],
    samples: &[C::Inner],
    kind: u32,
) where
    [C::Inner]: TiffValue,
{
    let mut image = encoder.new_image::<C>(columns, rows).unwrap();
    if kind != 0 {
        image.encoder().write_tag(Tag::NewSubfileType, kind).unwrap();
    }
    image.rows_per_strip(2).unwrap();
    image.write_data(samples).unwrap();
}

fn pages<C: ColorType, K: TiffKind>(
    mut encoder: TiffEncoder<File, K>,
    value: impl Fn(f32) -> C::Inner,
) where
    [C::Inner]: TiffValue,
{
    for frame in values().outer_iter() {
        let samples: Vec<C::Inner> = frame.iter().map(|v| value(*v)).collect();
        page::<C, K>(&mut encoder, [5, 7], &samples, 0);
    }
}

/// Makes white zero in every page: `PhotometricInterpretation` 0, SHORT, of one value.
fn invert(path: &Path, big: bool) {
    let mut bytes = fs::read(path).unwrap();
    let entry: &[u8] = match big {
        true => &[6, 1, 3, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1, 0],
        false => &[6, 1, 3, 0, 1, 0, 0, 0, 1, 0],
    };
    let places: Vec<usize> =
        (0..bytes.len() - entry.len()).filter(|at| bytes[*at..].starts_with(entry)).collect();
    assert_eq!(places.len(), SIDES[0], "an entry for each page");
    places.into_iter().for_each(|at| bytes[at + entry.len() - 2] = 0);
    fs::write(path, bytes).unwrap();
}

#[test]
fn samples_whose_white_is_zero_are_the_stored_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let check = |what: &str, big: bool| {
        invert(&path, big);
        let stack = StackFile::open(&path).unwrap();
        assert_eq!(stack.view(0).unwrap(), values(), "{what}");
        // Out of order, as bands of rows are read.
        for (index, rows) in [(2, 3..5), (0, 0..1), (1, 2..5), (0, 1..3)] {
            let frame = stack.frame(0, index, rows.clone()).unwrap();
            let rows = rows.start as usize..rows.end as usize;
            assert_eq!(frame, values().slice_move(s![index, rows, ..]), "{what}, page {index}");
        }
    };
    for big in [false, true] {
        macro_rules! written {
            ($color:ty, $value:expr) => {
                let file = File::create(&path).unwrap();
                match big {
                    true => pages::<$color, _>(TiffEncoder::new_big(file).unwrap(), $value),
                    false => pages::<$color, _>(TiffEncoder::new(file).unwrap(), $value),
                }
                check(stringify!($color), big);
            };
        }
        written!(Gray8, |v| v as u8);
        written!(Gray16, |v| v as u16);
        written!(Gray32, |v| v as u32);
        written!(Gray32Float, |v| v);
        written!(Gray64Float, f64::from);
    }
}

#[test]
fn samples_of_big_endian_files_whose_white_is_zero_are_the_stored_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let entries: [(u16, u16, u32); 8] = [
        (256, 3, 2),
        (257, 3, 1),
        (258, 3, 16),
        (259, 3, 1),
        (262, 3, 0),
        (273, 4, 8),
        (278, 3, 1),
        (279, 4, 4),
    ];
    let mut bytes = b"MM\0*\0\0\0\x0c\0\x07\x01\0\0\x08".to_vec();
    for (tag, kind, value) in entries {
        bytes.extend(tag.to_be_bytes());
        bytes.extend(kind.to_be_bytes());
        bytes.extend(1_u32.to_be_bytes());
        // A SHORT is at the beginning of its four bytes.
        bytes.extend(if kind == 3 { value << 16 } else { value }.to_be_bytes());
    }
    bytes.extend([0; 4]);
    fs::write(&path, bytes).unwrap();
    let frame = StackFile::open(&path).unwrap().frame(0, 0, 0..1).unwrap();
    assert_eq!(frame, ndarray::arr2(&[[7.0, 256.0]]));
}

/// A stack of 16 bits with one directory and this description: strips of two rows, big endian.
fn one_directory(about: &str, compression: u32) -> Vec<u8> {
    let text = format!("{about}\0");
    let values = values();
    let (rows, columns) = (SIDES[1], SIDES[2]);
    let strips: Vec<usize> = (0..rows).step_by(2).map(|row| (rows - row).min(2)).collect();
    let lists = 8 + 2 + 12 * 10 + 4;
    let first = lists + 8 * strips.len() + text.len();
    let number = |n: usize| u32::try_from(n).unwrap();
    let entries: [(u16, u16, usize, u32); 10] = [
        (256, 4, 1, number(columns)),
        (257, 4, 1, number(rows)),
        (258, 3, 1, 16),
        (259, 3, 1, compression),
        (262, 3, 1, 1),
        (270, 2, text.len(), number(lists + 8 * strips.len())),
        (273, 4, strips.len(), number(lists)),
        (277, 3, 1, 1),
        (278, 4, 1, 2),
        (279, 4, strips.len(), number(lists + 4 * strips.len())),
    ];
    let mut bytes = b"MM\0*\0\0\0\x08\0\x0a".to_vec();
    for (tag, kind, count, value) in entries {
        bytes.extend(tag.to_be_bytes());
        bytes.extend(kind.to_be_bytes());
        bytes.extend(number(count).to_be_bytes());
        bytes.extend(if kind == 3 { value << 16 } else { value }.to_be_bytes());
    }
    bytes.extend([0; 4]);
    let mut at = first;
    for height in &strips {
        bytes.extend(number(at).to_be_bytes());
        at += 2 * columns * height;
    }
    strips.iter().for_each(|height| bytes.extend(number(2 * columns * height).to_be_bytes()));
    bytes.extend(text.as_bytes());
    assert_eq!(bytes.len(), first);
    for value in &values {
        bytes.extend((*value as u16).to_be_bytes());
    }
    bytes
}

/// The description that `ImageJ` writes of a stack.
fn image_j(images: u32) -> String {
    format!("ImageJ=1.54f\nimages={images}\nslices=3\nloop=false\n")
}

#[test]
fn frames_behind_one_directory_are_read_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    fs::write(&path, one_directory(&image_j(3), 1)).unwrap();
    let stack = StackFile::open(&path).unwrap();
    assert_eq!(stack.shape(), [1, 3, 5, 7]);
    assert_eq!(stack.view(0).unwrap(), values());
    // Any rows, in any order.
    for (step, rows) in [(2, 1..4), (0, 4..5), (1, 0..3), (2, 0..1)] {
        let found = stack.frame(0, step, rows.clone()).unwrap();
        let wanted = rows.start as usize..rows.end as usize;
        assert_eq!(found, values().slice(s![step, wanted, ..]));
    }
    let refused = |bytes: &[u8], words: [&str; 2]| {
        fs::write(&path, bytes).unwrap();
        let message = StackFile::open(&path).unwrap_err().to_string();
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
    };
    let good = one_directory(&image_j(3), 1);
    refused(&good[..good.len() - 1], ["images=3", "the values of 2"]);
    refused(&one_directory(&image_j(3), 5), ["images=3", "one directory of compressed values"]);
    refused(&one_directory(&image_j(4), 1), ["images=4", "the values of 3"]);
    fs::write(&path, one_directory("{\"shape\": [3, 5, 7], \"truncated\": true}", 1)).unwrap();
    assert_eq!(StackFile::open(&path).unwrap().view(0).unwrap(), values());
    let set = "<OME><Pixels SizeZ=\"4\" SizeC=\"1\" SizeT=\"1\">";
    refused(&one_directory(set, 1), ["has 1 of the 4 frames", "OME-XML"]);
    refused(
        &one_directory("<OME><BinaryOnly/></OME>", 1),
        ["a part of an OME set", "another file"],
    );
    // Whole frames of a few bytes count, too; other bytes there are no frames.
    let unnamed = one_directory("a detector", 1);
    refused(&unnamed, ["values of 2 more", "a directory for each frame"]);
    refused(&one_directory(&image_j(1), 1), ["values of 2 more", "a directory for each frame"]);
    fs::write(&path, &unnamed[..unnamed.len() - 2]).unwrap();
    assert_eq!(StackFile::open(&path).unwrap().shape(), [1, 1, 5, 7]);
    // Values of three frames of 64 KiB, and a directory of one without a description.
    let entries: [(u16, u32); 9] = [
        (256, 256),
        (257, 256),
        (258, 8),
        (259, 1),
        (262, 1),
        (273, 122),
        (277, 1),
        (278, 256),
        (279, 1 << 16),
    ];
    let mut bytes = b"II*\0\x08\0\0\0\x09\0".to_vec();
    for (tag, value) in entries {
        bytes.extend(tag.to_le_bytes());
        bytes.extend([4, 0, 1, 0, 0, 0]);
        bytes.extend(value.to_le_bytes());
    }
    bytes.resize(122 + (3 << 16), 0);
    refused(&bytes, ["values of 2 more", "a directory for each frame"]);
    bytes.truncate(122 + (1 << 16));
    fs::write(&path, &bytes).unwrap();
    assert_eq!(StackFile::open(&path).unwrap().shape(), [1, 1, 256, 256]);
    // Directories of another number.
    let mut encoder = TiffEncoder::new(File::create(&path).unwrap()).unwrap();
    for about in ["ImageJ=1.54f\nimages=3\n", ""] {
        let mut image = encoder.new_image::<Gray8>(2, 1).unwrap();
        image.encoder().write_tag(Tag::ImageDescription, about).unwrap();
        image.write_data(&[1, 2]).unwrap();
    }
    drop(encoder);
    let bytes = fs::read(&path).unwrap();
    refused(&bytes, ["images=3", "directories of 2"]);
}

#[test]
fn reduced_copies_of_pages_are_no_frames() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let mut encoder = TiffEncoder::new(File::create(&path).unwrap()).unwrap();
    page::<RGB8, _>(&mut encoder, [2, 2], &[0; 12], 1);
    for frame in values().outer_iter() {
        let samples: Vec<f32> = frame.iter().copied().collect();
        page::<Gray32Float, _>(&mut encoder, [5, 7], &samples, 0);
        page::<Gray32Float, _>(&mut encoder, [1, 1], &[9.0], 1);
        // A reduced copy of the same size.
        page::<Gray32Float, _>(&mut encoder, [5, 7], &[9.0; 35], 3);
    }
    drop(encoder);
    let stack = StackFile::open(&path).unwrap();
    assert_eq!(stack.shape(), [1, 3, 5, 7]);
    assert_eq!(stack.view(0).unwrap(), values());

    let mut encoder = TiffEncoder::new(File::create(&path).unwrap()).unwrap();
    page::<Gray8, _>(&mut encoder, [2, 2], &[0; 4], 1);
    drop(encoder);
    let message = StackFile::open(&path).unwrap_err().to_string();
    assert!(message.contains("1 reduced copies") && message.contains("no frame"), "{message}");
}

#[test]
fn a_file_of_several_frames_in_a_folder_of_frames_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (name, count) in [("f_0.tif", 1), ("f_1.tif", 2)] {
        let file = File::create(folder.path().join(name)).unwrap();
        let mut encoder = TiffEncoder::new(file).unwrap();
        (0..count).for_each(|_| page::<Gray8, _>(&mut encoder, [1, 2], &[3, 4], 0));
    }
    let stack = StackFile::open(folder.path()).unwrap();
    assert!(stack.frame(0, 0, 0..1).is_ok());
    let message = stack.frame(0, 1, 0..1).unwrap_err().to_string();
    assert!(message.contains("f_1.tif") && message.contains("2 frames"), "{message}");
}
