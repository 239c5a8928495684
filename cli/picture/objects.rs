//! Colours and names of objects in slices of labels.

use super::colour::{NO_VALUE, Rgb, SMALL};
use super::drawing::{Anchor, Area, Drawing, GREY, INK, Paint, text_width};
use super::palette::colour_of_label;
use super::text::cut;
use crate::numbers;
use std::collections::{BTreeMap, BTreeSet};

/// Height of a line of the legend.
const LINE: f64 = 20.0;
/// Side of a colour beside a name.
const SQUARE: f64 = 14.0;
/// Widest name.
const WIDEST: f64 = 230.0;
/// Most names of a legend: more colours do not differ.
const MOST: usize = 22;

/// Objects of a picture, by label.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Objects {
    names: Vec<(u32, String)>,
}

impl Objects {
    /// The objects that occur among labels. `names`: of all labels; a label without a name is its number.
    pub(crate) fn among(names: &BTreeMap<u32, String>, labels: impl Iterator<Item = f64>) -> Self {
        let found: BTreeSet<u32> = labels.filter_map(label).collect();
        let name =
            |label: u32| names.get(&label).cloned().unwrap_or_else(|| format!("label {label}"));
        Self { names: found.into_iter().map(|label| (label, name(label))).collect() }
    }

    /// Room to the right of an image.
    pub(super) fn width(&self) -> f64 {
        let widest = self.names.iter().map(|(_, name)| text_width(name, SMALL)).fold(0.0, f64::max);
        SQUARE + 12.0 + widest.min(WIDEST)
    }

    /// Height of the legend.
    pub(super) fn height(&self) -> f64 {
        LINE * (self.names.len().min(MOST) + usize::from(self.names.len() > MOST)) as f64
    }

    /// Draws a colour with a name for each object, from the corner at the top left on.
    pub(super) fn legend(&self, drawing: &mut Drawing, [left, top]: [f64; 2]) {
        let mut y = top;
        for (label, name) in self.names.iter().take(MOST) {
            let square = Area::new(left, y, SQUARE, SQUARE);
            drawing.area(square, Paint::fill(colour_of_label(*label)));
            drawing.area(square, Paint::line(GREY, 0.8));
            let name = cut(name, WIDEST, SMALL);
            drawing.text([left + SQUARE + 7.0, y + 11.0], name, SMALL, INK, Anchor::Start);
            y += LINE;
        }
        if self.names.len() > MOST {
            let more = format!("and {} more", self.names.len() - MOST);
            drawing.text([left + SQUARE + 7.0, y + 11.0], more, SMALL, GREY, Anchor::Start);
        }
    }
}

/// Colour of a value of a volume of labels.
pub(super) fn colour(value: f64) -> Rgb {
    label(value).map_or(NO_VALUE, colour_of_label)
}

/// The label that a value is; `None` for values that are no whole numbers from 0 on.
fn label(value: f64) -> Option<u32> {
    let rounded = value.round();
    ((0.0..=f64::from(u32::MAX)).contains(&rounded) && (value - rounded).abs() < 1e-6)
        .then(|| numbers::whole(rounded))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_that_occur_are_named_in_their_order() {
        let names = [(0, "around".to_owned()), (1, "rod".to_owned()), (2, "pin".to_owned())];
        let found = Objects::among(&names.into(), [2.0, 0.0, 2.0, 7.0, f64::NAN].into_iter());
        let names: Vec<&str> = found.names.iter().map(|(_, name)| name.as_str()).collect();
        assert_eq!(names, ["around", "pin", "label 7"]);
        assert_eq!([colour(0.5), colour(-1.0), colour(f64::NAN)], [NO_VALUE; 3]);
        assert_ne!(colour(1.0), colour(2.0));
    }
}
