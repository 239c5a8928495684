//! Functions of the command line beyond the public interface of beamlet. Nothing here is stable, and no
//! test needs more of it than the command line does.

pub use crate::check::display::count;
pub use crate::check::inputs::load_scene;
pub use crate::parallel::start_threads;
pub use crate::reserve::require_memory;
pub use crate::run::quality::resolved as with_tolerances;
pub use crate::scene::formula::check_formula;
pub use crate::scene::schema::json_schema;
pub use crate::whole_file::write_file;

/// Text for terminals and pages.
pub mod printed {
    pub use crate::printed::{is_unsafe, line, lines, number, path};
}
/// Quantities with units.
pub mod units {
    pub use crate::units::{Dimension, QuantityError, memory_size};
}
/// Built-in materials.
pub mod material {
    pub use crate::material::builtin::{Builtin, builtin, builtin_names, builtins};
}
