//! Names that the files of rows share: what rows are made of, and what reads, writes and checks them.

pub(super) use std::path::PathBuf;

pub(crate) use super::faults::in_range;
pub(super) use super::faults::{Faults, named, too_long, whole};
pub(crate) use super::record::{Keys, OneOf, keys};
pub(super) use super::record::{Record, inline};
pub(crate) use super::row::Group::Forms;
pub(super) use super::row::Group::With;
pub(super) use super::row::Kind::{
    self, Bits, Corners, Count, Counts, Direction, Either, Ends, File, Flag, Hash, Inner, Lengths,
    Line, Lists, Name, Named, Number, Pair, Quantity, Rectangles, Series, Step, Tables, Unit, Word,
};
pub(super) use super::row::Need::{self, Default, Required, Without};
pub(super) use super::row::{ANY, IMAGE, MATERIAL, NOT_NEGATIVE, POSITIVE, Range, Row, within};
pub(crate) use super::value::{Base, refuse_beyond, words};
pub(super) use super::value::{Value, optional, required};
pub(super) use crate::scene::limits;
pub(super) use crate::scene::table::{ListItem, Table};
pub(super) use crate::scene::text::{list, number, quantity, quoted};
pub(super) use beamlet_core::units::Dimension::{
    self, Angle, Attenuation, Current, Density, Energy, Length, Time, Voltage,
};
pub(super) use beamlet_core::{Error, Result, printed};
