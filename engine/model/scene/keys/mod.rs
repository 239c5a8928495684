//! The table of keys of a scene file: one row a key, from which reading, `--set`, the resolved scene,
//! ranges, suggestions, docs/scene.md and the JSON Schema come.
//!
//! | file | holds |
//! |---|---|
//! | `row.rs` | what a row says, and what follows from it in words |
//! | `faults.rs` | errors of ranges |
//! | `value.rs` | values by their kind: reading, writing, checking |
//! | `record.rs` | structs by their rows; the macro that makes both |
//! | `prelude.rs` | names that the files of rows share |
//! | others | rows by subject, each with the code that a row does not say |
//! | `top.rs` | the top level of the file |
//! | `docs.rs`, `schema.rs` | the tables of docs/scene.md; the JSON Schema |

pub(super) mod faults;
mod prelude;
pub(super) mod record;
pub(super) mod row;
pub(super) mod value;

pub(super) mod detector;
pub(super) mod frames;
pub(super) mod mask;
pub(super) mod material;
pub(super) mod motion;
pub(super) mod object;
pub(super) mod packing;
mod rectangles;
pub(super) mod sampling;
pub(super) mod scan;
pub(super) mod series;
pub(super) mod shape;
pub(super) mod source;
pub(super) mod spot;
mod steps;
pub(super) mod surroundings;
pub(super) mod top;

pub mod docs;
pub(super) mod schema;
