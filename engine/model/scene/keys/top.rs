//! The top level of a scene file.

use super::detector::DETECTOR;
use super::mask::MASK;
use super::material::MATERIALS;
use super::object::{OBJECT, SURROUNDINGS};
use super::prelude::*;
use super::sampling::SAMPLING;
use super::scan::SCAN;
use super::source::SOURCE;

const MATERIAL: Kind = Inner(&MATERIALS.spec);

keys! { TOP, "", [], ["sample" => "object", "objects" => "object", "mesh" => "object", "tube" => "source"];
    title => Line, Without("none"), r#""Nylon bracket, 11 steps""#, "Name of the scene, for people.";
    source => Inner(&SOURCE.spec), Required, "{ ... }", "X-ray source on the optical axis.";
    detector => Inner(&DETECTOR.spec), Required, "{ ... }", "Flat detector across the optical axis.";
    sample_mask => Inner(&MASK.spec), Without("none"), "{ ... }", "Mask before the sample.";
    detector_mask => Inner(&MASK.spec), Without("none"), "{ ... }", "Mask before the detector.";
    sampling => Inner(&SAMPLING.spec), Without("defaults"), "{ ... }", "How rays are chosen.";
    scan => Inner(&SCAN.spec), Without("one frame"), "{ ... }", "Mask offsets and angles.";
    materials => Named(&MATERIAL), Without("built-in ones"), "{ ... }", "Materials by name.";
    surroundings => Inner(&SURROUNDINGS), Without("vacuum"), "{ ... }", "Surroundings of the objects.";
    object => Tables(&OBJECT.spec), Without("none"), "[[object]]",
        "Objects of the sample; where they overlap, the object listed later wins.";
    files => Named(&Hash), Without("none"), "{ ... }", "SHA-256 of files that the scene refers to, by path.";
}

/// Reads one line of text.
pub(crate) fn read_title(item: &ListItem<'_>, row: &Row) -> Result<String> {
    let is_line = |text: &&str| {
        !text.trim().is_empty()
            && text.chars().count() <= limits::TITLE
            && !text.chars().any(printed::is_unsafe)
    };
    match item.as_text().filter(is_line) {
        Some(text) => Ok(text.trim().to_owned()),
        None => item.refuse(item.mismatch(row.allowed()), String::new()),
    }
}
