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

pub(crate) mod faults;
mod prelude;
pub(crate) mod record;
pub(crate) mod row;
pub(crate) mod value;

pub(crate) mod detector;
pub(crate) mod frames;
pub(crate) mod mask;
pub(crate) mod material;
pub(crate) mod motion;
pub(crate) mod object;
pub(crate) mod packing;
pub(crate) mod sampling;
pub(crate) mod scan;
pub(crate) mod series;
pub(crate) mod shape;
pub(crate) mod source;
pub(crate) mod spot;
pub(crate) mod surroundings;
pub(crate) mod top;

pub(crate) mod docs;
pub(crate) mod schema;
