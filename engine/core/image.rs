//! Images of one channel from files, as a detector, a kernel or a focal spot was measured:
//! NPY, TIFF or PNG by the extension.

use crate::array_file::{ArrayFile, Format, endings};
use crate::{Error, Result, input_file, reserve};
use ndarray::Array2;
use std::io::BufReader;
use std::path::Path;

/// Most pixels of an image.
const PIXELS: u64 = 1 << 26;

/// Reads an image, `[row][column]`, row 0 on top, in the units of the file: whole numbers of 8 to
/// 32 bits or floats, grey, on one page.
///
/// # Errors
/// [`Error::File`] where the file cannot be read or holds no such image; [`Error::Memory`] for
/// one of more than 2^26 pixels.
pub fn read(path: &Path) -> Result<Array2<f64>> {
    let is_png = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png"));
    match Format::of(path) {
        _ if is_png => read_png(path),
        None | Some(Format::Exr) => {
            let endings = endings(|format| format != Format::Exr);
            Err(refused(path, format!("must end in {endings} or .png")))
        }
        Some(format) => read_array(path, format),
    }
}

fn refused(path: &Path, problem: impl std::fmt::Display) -> Error {
    Error::file(path, format!("cannot be read as an image: it {problem}"), None)
}

fn shaped(path: &Path, rows: u64, columns: u64, values: Vec<f64>) -> Result<Array2<f64>> {
    let shape = (usize::try_from(rows), usize::try_from(columns));
    let (Ok(rows), Ok(columns)) = shape else { return Err(refused(path, "is too large")) };
    Array2::from_shape_vec((rows, columns), values)
        .map_err(|_| refused(path, "does not hold one value for each pixel"))
}

/// Pixels of an image, none of whose sides is zero.
fn check_size(path: &Path, rows: u64, columns: u64) -> Result<usize> {
    if rows == 0 || columns == 0 {
        return Err(refused(path, "has no pixels"));
    }
    let pixels = rows.checked_mul(columns).filter(|pixels| *pixels <= PIXELS);
    match pixels.and_then(|pixels| usize::try_from(pixels).ok()) {
        Some(pixels) => Ok(pixels),
        None => Err(Error::Memory {
            purpose: format!("the image {} of {columns} x {rows} pixels", path.display()),
            needed: rows.saturating_mul(columns).saturating_mul(8),
            available: Some(8 * PIXELS),
            remedy: "bin the image to fewer pixels".into(),
        }),
    }
}

fn read_array(path: &Path, format: Format) -> Result<Array2<f64>> {
    let array = ArrayFile::open(path, format)?;
    let sides = array.sides();
    let &[rows, columns] = sides.as_slice() else {
        return Err(refused(path, format!("has the shape {sides:?}; allowed: two dimensions")));
    };
    check_size(path, rows, columns)?;
    let values = array.read(0, 0..crate::numbers::length(rows))?;
    if array.is_fortran() {
        return Ok(shaped(path, columns, rows, values)?.reversed_axes());
    }
    shaped(path, rows, columns, values)
}

fn read_png(path: &Path) -> Result<Array2<f64>> {
    let failed = |error| refused(path, format!("is not a readable PNG file: {error}"));
    let file =
        input_file::open(path).map_err(|error| Error::file(path, "cannot be read", Some(error)))?;
    let mut decoder = png::Decoder::new(BufReader::new(file));
    // Grey of 1, 2 or 4 bits becomes 8, with the same proportions.
    decoder.set_transformations(png::Transformations::EXPAND);
    let header = decoder.read_header_info().map_err(failed)?;
    let (columns, rows) = (u64::from(header.width), u64::from(header.height));
    check_size(path, rows, columns)?;
    let mut reader = decoder.read_info().map_err(failed)?;
    let (colour, depth) = reader.output_color_type();
    if colour != png::ColorType::Grayscale {
        return Err(refused(path, format!("is {colour:?}; allowed: one grey channel")));
    }
    let size = reader.output_buffer_size().ok_or_else(|| refused(path, "is too large"))?;
    let mut bytes = reserve::zeroed::<u8>(size, "an image")?;
    reader.next_frame(&mut bytes).map_err(failed)?;
    let values = match depth {
        png::BitDepth::Sixteen => {
            bytes.as_chunks().0.iter().map(|&pair| u16::from_be_bytes(pair).into()).collect()
        }
        _ => bytes.into_iter().map(f64::from).collect(),
    };
    shaped(path, rows, columns, values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;
    use std::fs::File;

    fn wanted() -> Array2<f64> {
        array![[0.0, 1.0, 2.0], [250.0, 128.0, 3.0]]
    }

    #[test]
    fn npy_tiff_and_png_hold_the_same_image() {
        let place = tempfile::tempdir().unwrap();
        let npy = place.path().join("image.npy");
        ndarray_npy::write_npy(&npy, &wanted().mapv(crate::numbers::single)).unwrap();
        let turned = place.path().join("turned.npy");
        ndarray_npy::write_npy(
            &turned,
            &wanted().reversed_axes().as_standard_layout().reversed_axes(),
        )
        .unwrap();
        let bytes: Vec<u8> = wanted().iter().map(|v| crate::numbers::whole(*v)).collect();
        let tif = place.path().join("image.TIF");
        let mut file = File::create(&tif).unwrap();
        tiff::encoder::TiffEncoder::new(&mut file)
            .unwrap()
            .write_image::<tiff::encoder::colortype::Gray8>(3, 2, &bytes)
            .unwrap();
        let png = place.path().join("image.png");
        let mut encoder = png::Encoder::new(File::create(&png).unwrap(), 3, 2);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.write_header().unwrap().write_image_data(&bytes).unwrap();
        for path in [npy, turned, tif, png] {
            assert_eq!(read(&path).unwrap(), wanted(), "{}", path.display());
        }
    }

    #[test]
    fn several_pages_are_no_image() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("pages.tif");
        let mut file = tiff::encoder::TiffEncoder::new(File::create(&path).unwrap()).unwrap();
        for page in [[1; 6], [2; 6]] {
            file.write_image::<tiff::encoder::colortype::Gray8>(3, 2, &page).unwrap();
        }
        assert!(read(&path).unwrap_err().to_string().contains("shape [2, 2, 3]"));
    }
}
