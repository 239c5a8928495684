//! Where objects of an assembly overlap, touch or nearly do, by their names.

use crate::geometry::{ContactKind, Sample};
use crate::printed::number;
use serde::Serialize;
use std::fmt::{self, Display, Formatter};

/// Two objects that overlap, touch or nearly do.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CheckedContact {
    /// Name of the object that is listed first, and gives way.
    pub earlier: String,
    /// Name of the object that is listed later, and wins.
    pub later: String,
    /// Kind of the contact.
    pub kind: ContactKind,
    /// A place of it, m.
    pub place: [f64; 3],
    /// Number of pairs of instances with this contact; 1 if neither object has instances.
    pub pairs: u64,
}

/// The contacts of a sample by name.
pub(super) fn contacts(sample: &Sample) -> Vec<CheckedContact> {
    let name = |object: u32| {
        sample.objects.get(object as usize).map(|it| it.name.clone()).unwrap_or_default()
    };
    let named = |contact: &crate::geometry::Contact| CheckedContact {
        earlier: name(contact.objects[0]),
        later: name(contact.objects[1]),
        kind: contact.kind,
        place: contact.place,
        pairs: contact.pairs,
    };
    sample.contacts.iter().map(named).collect()
}

/// Later objects that overlap an object.
pub(super) fn winners(sample: &Sample, object: usize) -> impl Iterator<Item = u32> {
    let overlaps = sample.contacts.iter().filter(move |it| {
        it.objects[0] as usize == object && matches!(it.kind, ContactKind::Overlap { .. })
    });
    overlaps.map(|it| it.objects[1])
}

impl Display for CheckedContact {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { earlier, later, kind, place, pairs } = self;
        match earlier == later {
            true => write!(f, "instances of \"{earlier}\" ")?,
            false => write!(f, "\"{earlier}\" and \"{later}\" ")?,
        }
        match kind {
            ContactKind::Overlap { volume, depth } => {
                let (volume, depth) = (number(volume * 1e9), number(depth * 1e6));
                write!(f, "overlap: {volume} mm3, {depth} um deep; \"{later}\" wins")?;
            }
            ContactKind::Touch { area } if *area > 0.0 => {
                write!(f, "touch: {} mm2", number(area * 1e6))?;
            }
            ContactKind::Touch { .. } => write!(f, "touch in a line or a point")?,
            ContactKind::Gap { width } => {
                let width = number(width * 1e6);
                match pairs {
                    1 => write!(f, "nearly touch: {width} um apart")?,
                    _ => write!(f, "nearly touch: {pairs} pairs, at least {width} um apart")?,
                }
            }
        }
        let [x, y, z] = place.map(|it| number(it * 1e3));
        write!(f, "; near ({x}, {y}, {z}) mm")
    }
}
