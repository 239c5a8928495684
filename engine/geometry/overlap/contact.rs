//! What there is to say of two objects that overlap, touch or nearly do.

use serde::Serialize;

/// Two objects that overlap, touch or nearly do.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Contact {
    /// Indices of the objects; the later one wins.
    pub objects: [u32; 2],
    /// Kind of the contact.
    pub kind: ContactKind,
    /// A place of it, m: the deepest of an overlap, the narrowest of a gap.
    pub place: [f64; 3],
    /// Number of pairs of instances with this contact; 1 if neither object has instances. Both objects
    /// are the same for instances of one object.
    pub pairs: u64,
}

/// Kind of a contact of two objects.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum ContactKind {
    /// They overlap, and the earlier one is cut.
    Overlap {
        /// Of the overlap, m3.
        volume: f64,
        /// Farthest that the surface of one lies in the other, m.
        depth: f64,
    },
    /// Their surfaces coincide within rounding, or touch in a line or a point.
    Touch {
        /// Where they lie on each other, m2; 0 for a line or a point.
        area: f64,
    },
    /// They do not touch, but come within a micrometre or the height of the arc over a facet.
    Gap {
        /// Where it is narrowest, m.
        width: f64,
    },
}

impl Contact {
    /// Contacts in the order of their objects; contacts of one kind between two objects are joined.
    pub(in crate::geometry) fn joined(all: impl Iterator<Item = Self>) -> Vec<Self> {
        let mut all: Vec<Self> = all.collect();
        all.sort_by_key(|it| (it.objects, it.kind.rank()));
        let mut joined: Vec<Self> = Vec::with_capacity(all.len());
        for contact in all {
            let known = joined.last_mut().filter(|it| it.objects == contact.objects);
            match known.and_then(|it| Some((it.kind.with(contact.kind)?, it))) {
                Some(((kind, is_worse), known)) => {
                    let place = if is_worse { contact.place } else { known.place };
                    *known = Self { kind, place, pairs: known.pairs + contact.pairs, ..*known };
                }
                None => joined.push(contact),
            }
        }
        joined
    }
}

impl ContactKind {
    const fn rank(self) -> u8 {
        match self {
            Self::Overlap { .. } => 0,
            Self::Touch { .. } => 1,
            Self::Gap { .. } => 2,
        }
    }

    /// Two of one kind as one, and whether the second has the place of it; `None` where they are of
    /// two kinds.
    fn with(self, other: Self) -> Option<(Self, bool)> {
        match (self, other) {
            (Self::Overlap { volume, depth }, Self::Overlap { volume: more, depth: other }) => {
                let both = Self::Overlap { volume: volume + more, depth: depth.max(other) };
                Some((both, other > depth))
            }
            (Self::Touch { area }, Self::Touch { area: more }) => {
                Some((Self::Touch { area: area + more }, more > area))
            }
            (Self::Gap { width }, Self::Gap { width: other }) => {
                Some((Self::Gap { width: width.min(other) }, other < width))
            }
            _ => None,
        }
    }
}
