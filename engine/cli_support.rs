//! Functions of the command line beyond the public interface of beamlet. Nothing here is stable, and no
//! test needs more of it than the command line does.

pub use crate::check::display::count;
pub use crate::check::inputs::load_scene;
pub use beamlet_core::numbers;
pub use beamlet_core::parallel::{is_fork, start_threads};
pub use beamlet_core::reserve::require_memory;
pub use beamlet_core::whole_file::write_file;
pub use beamlet_files::views_of_part;
pub use beamlet_geometry::Placed;
pub use beamlet_model::media::MaterialTable;
pub use beamlet_model::optics::FrontView;
pub use beamlet_model::scene::formula::check_formula;
pub use beamlet_model::scene::schema::json_schema;

/// Text for terminals and pages.
pub mod printed {
    pub use beamlet_core::printed::{is_unsafe, line, lines, number, path, with_unit};
}
/// Tables of options of verbs.
pub mod options {
    pub use beamlet_core::options::{
        Choice, Hyphens, Keyword, Need, OptionValue, Options, Refusal, Relation, Row, Word,
        form_rows, keywords, literals, page_rows, typed_dict,
    };
    pub use beamlet_recon::reconstruct::{Centre, ReconstructArguments};
    pub use beamlet_recon::retrieve::{Offsets, RetrieveArguments};
}
/// Reconstruction of arrays.
pub mod reconstruct {
    pub use beamlet_recon::reconstruct::{SinogramVolume, Sinograms, reconstruct_sinograms};
}
/// Quantities with units.
pub mod units {
    pub use beamlet_core::units::{Dimension, QuantityError, memory_size, number};
}
/// Built-in materials.
pub mod material {
    pub use beamlet_model::material::builtin;
    pub use beamlet_model::material::builtin::{Builtin, builtin_names, builtins};
}
