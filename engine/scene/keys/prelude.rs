//! Names that the files of rows share: what rows are made of, and what reads, writes and checks them.

pub(super) use std::path::PathBuf;

pub(super) use super::faults::{Faults, in_range, named, whole};
pub(super) use super::record::{Keys, OneOf, Record, inline, keys};
pub(super) use super::row::Group::{Forms, With};
pub(super) use super::row::Kind::{
    self, Corners, Count, Counts, Direction, Either, File, Flag, Hash, Inner, Lengths, Line, Lists,
    Name, Named, Number, Pair, Quantity, Series, Step, Tables, Unit, Word,
};
pub(super) use super::row::Need::{self, Default, Required, Without};
pub(super) use super::row::{ANY, IMAGE, MATERIAL, NOT_NEGATIVE, POSITIVE, Range, Row, within};
pub(super) use super::value::{Base, Value, optional, refuse_beyond, required, words};
pub(super) use crate::scene::limits;
pub(super) use crate::scene::table::{ListItem, Table};
pub(super) use crate::scene::text::{list, number, quantity, quoted};
pub(super) use crate::units::Dimension::{
    self, Angle, Attenuation, Density, Energy, Length, Voltage,
};
pub(super) use crate::{Error, Result, printed};
