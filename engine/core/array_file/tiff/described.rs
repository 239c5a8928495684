//! Number of frames in the description of the first page: of `ImageJ`, of Python's `tifffile`, of OME.

use super::read::Pages;
use tiff::TiffResult;
use tiff::tags::Tag;

/// Frames that a description counts.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Described {
    /// Frames in the file, with the words that count them.
    Here(u64, String),
    /// Frames in a set of OME files; 0 where another file of the set counts them.
    Set(u64),
}

impl Described {
    /// Frames that the description of the page in turn counts; `None` for pages without such a description. `frame`:
    /// rows and columns.
    pub(super) fn of(pages: &mut Pages, frame: [usize; 2]) -> TiffResult<Option<Self>> {
        let Some(value) = pages.find_tag(Tag::ImageDescription)? else { return Ok(None) };
        Ok(value.into_string().ok().and_then(|text| Self::parse(&text, frame)))
    }

    fn parse(text: &str, frame: [usize; 2]) -> Option<Self> {
        if text.starts_with("ImageJ=") {
            let images = text.lines().find_map(|line| line.strip_prefix("images="))?;
            let images = images.trim().parse().ok().filter(|images| *images > 0)?;
            return Some(Self::Here(images, format!("images={images}")));
        }
        if text.trim_start().starts_with('{') {
            let (_, shape) = text.split_once("\"shape\"")?;
            let (shape, _) = shape.split_once('[')?.1.split_once(']')?;
            let sides: Option<Vec<u64>> =
                shape.split(',').map(|side| side.trim().parse().ok()).collect();
            let values = sides?.into_iter().try_fold(1_u64, u64::checked_mul)?;
            let pixels =
                (frame[0] as u64).checked_mul(frame[1] as u64).filter(|pixels| *pixels > 0)?;
            let is_whole = values > 0 && values % pixels == 0;
            return is_whole.then(|| Self::Here(values / pixels, format!("the shape [{shape}]")));
        }
        if !text.contains("<OME") {
            return None;
        }
        if text.contains("<BinaryOnly") {
            return Some(Self::Set(0));
        }
        let planes = |pixels: &str| {
            let tag = pixels.split_once('>').map_or(pixels, |(tag, _)| tag);
            let side = |name: &str| {
                let (_, value) = tag.split_once(&format!("{name}=\""))?;
                value.split_once('"')?.0.trim().parse::<u64>().ok()
            };
            [side("SizeZ")?, side("SizeC")?, side("SizeT")?]
                .into_iter()
                .try_fold(1, u64::checked_mul)
        };
        let images: Option<Vec<u64>> = text.split("<Pixels").skip(1).map(planes).collect();
        Some(Self::Set(images?.into_iter().try_fold(0, u64::checked_add)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn descriptions_count_frames() {
        let pixels = "<Pixels SizeX=\"8\" SizeY=\"6\" SizeZ=\"5\" SizeC=\"2\" SizeT=\"1\">";
        let here = |count, words: &str| Some(Described::Here(count, words.into()));
        for (text, wanted) in [
            ("ImageJ=1.54f\nimages=7\nslices=7\n".to_owned(), here(7, "images=7")),
            ("ImageJ=1.54f\nunit=um\n".to_owned(), None),
            ("{\"shape\": [7, 6, 8], \"a\": 1}".to_owned(), here(7, "the shape [7, 6, 8]")),
            ("{\"shape\": [7, 6, 9]}".to_owned(), None),
            ("{\"shape\": [18446744073709551615, 6, 8]}".to_owned(), None),
            (
                format!("<?xml?><OME a=\"\">{pixels}<TiffData/></Pixels></OME>"),
                Some(Described::Set(10)),
            ),
            ("<OME><BinaryOnly MetadataFile=\"a\"/></OME>".to_owned(), Some(Described::Set(0))),
            ("<OME><Pixels SizeZ=\"x\"/></OME>".to_owned(), None),
            ("a detector, images=7".to_owned(), None),
        ] {
            assert_eq!(Described::parse(&text, [6, 8]), wanted, "{text}");
        }
    }
}
