//! Internal to beamlet: structs and constants shared by host and shaders, in one table that makes the GLSL
//! ([`glsl_files`]); tests/device/interface.rs compares the structs with every compiled shader.
//!
//! Shaders include `interface.glsl`, with all structs in `scalar` layout and all constants, and
//! `interface/NAME.glsl` for a block of push constants, a struct whose name ends in `Push`. `in
//! Rays(readonly)` behind a struct declares a buffer reference to an array of them; `u64 => Rays` is an
//! address that a shader sees as that reference. Other addresses are `uvec2` in shaders, as required in
//! structs that shaders hold as values: some drivers (`SwiftShader`) cannot load a struct with references
//! in it.
//!
//! `NAME_WORDS` and `NAME_FIELD` are made for each struct: its words, and the word where a field
//! begins, for shaders that read records word by word.

mod glsl;

use std::mem::offset_of;

/// A struct that host and kernels share.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Name of the struct or block, the same in GLSL.
    pub name: &'static str,
    /// Size in bytes: the stride of an array of them.
    pub size: usize,
    /// Buffer references to arrays of it: name and access.
    pub buffers: &'static [(&'static str, &'static str)],
    /// In order.
    pub fields: &'static [Field],
}

/// A field of a shared struct.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Field {
    /// Its name, the same in GLSL.
    pub name: &'static str,
    /// Bytes before it.
    pub offset: usize,
    /// Size in bytes.
    pub size: usize,
    /// Its type in Rust.
    pub rust: &'static str,
    /// Its type in GLSL, where that does not follow from the type in Rust.
    pub glsl: Option<&'static str>,
}

/// Declares structs shared with kernels (`#[repr(C)]`, `Pod`) and a table `$table` of their layouts.
/// Structs and fields have the same names in GLSL.
#[macro_export]
#[doc(hidden)]
macro_rules! shared_structs {
    (
        $(#[$table_attribute:meta])* $table_visibility:vis $table:ident;
        $(
            $(#[$attribute:meta])*
            $visibility:vis struct $name:ident $( in $( $buffer:ident $( ($access:ident) )? ),+ )? {
                $(
                    $(#[$field_attribute:meta])*
                    $field_visibility:vis $field:ident: $type:ty $( => $glsl:ident )?
                ),* $(,)?
            }
        )*
    ) => {
        $(
            $(#[$attribute])*
            #[derive(Debug, Clone, Copy, PartialEq, ::bytemuck::Pod, ::bytemuck::Zeroable)]
            // Addresses come first in every struct; packing spares them tail padding.
            #[repr(C, packed(4))]
            #[allow(missing_docs, reason = "most names of fields say all")]
            $visibility struct $name {
                $( $(#[$field_attribute])* $field_visibility $field: $type, )*
            }
        )*
        $(#[$table_attribute])*
        $table_visibility const $table: &[$crate::Layout] = &[
            $( $crate::Layout {
                name: stringify!($name),
                size: ::core::mem::size_of::<$name>(),
                buffers: &[ $( $( (stringify!($buffer), concat!($( stringify!($access) )?)), )+ )? ],
                fields: &[ $( $crate::Field {
                    name: stringify!($field),
                    offset: ::core::mem::offset_of!($name, $field),
                    size: ::core::mem::size_of::<$type>(),
                    rust: stringify!($type),
                    glsl: $crate::shared_structs!(@glsl $( $glsl )?),
                }, )* ],
            }, )*
        ];
    };
    (@glsl $glsl:ident) => { Some(stringify!($glsl)) };
    (@glsl) => { None };
}

/// Declares constants shared with kernels, and a table of them.
macro_rules! shared_constants {
    ($( $(#[$attribute:meta])* $name:ident: $type:ty = $value:expr; )*) => {
        $( $(#[$attribute])* pub const $name: $type = $value; )*

        /// Name, type in Rust, and value of each.
        pub(crate) fn constants() -> Vec<(&'static str, &'static str, String)> {
            vec![ $( (stringify!($name), stringify!($type), format!("{:?}", $name)), )* ]
        }
    };
}

mod constants;
mod fit;
mod light;
mod reconstruct;
mod walk;
mod wave;

pub use constants::*;
pub use fit::{FitPush, Step};
pub use glsl::glsl_files;
pub use light::{
    Aperture, BarLayer, BeamletGeometry, Cell, CellRow, CellRowPart, EnergiesPush, EnergyParams,
    EnergyResult, EnergyRow, GatherPush, HeightParams, IlluminatePush, IlluminationParams, Mask,
    MaskHeights, MaskStrip, Pixel, RandomLightPush, RandomRaysPush, RowGeometry, SpotPart,
};
pub use reconstruct::{
    BackProjectPush, CombinePush, DotPush, DotSum, FourierPush, MovedSheet, MovedView,
    ProjectBackMovedPush, ProjectBackPush, ProjectMovedPush, ProjectPush, Sheet, SinogramPush,
    Slopes, StepLaw, ViewTurn,
};
pub use walk::{
    AnalyticShape, Constants, Crossing, CrossingsPush, ExactPush, Leaf, Node, Placed,
    PoseTransform, Prototype, Ray, RayResult, Sample, ScatteringAxis, Surface, SurfaceCrossing,
    TracePush,
};
pub use wave::{
    WaveBeamlet, WaveField, WaveFieldPush, WaveLine, WaveLinePush, WaveMaterial, WavePair,
    WaveParams,
};

impl RayResult {
    /// Displacement along z on the detector, m; `gap`: from analyser to detector, m.
    #[must_use]
    pub fn landing_z(&self, gap: f32) -> f32 {
        self.displacement_z + gap * self.slope_z
    }

    /// Shift of the edges of pixels on the analyser, m, by what light moves along x behind it; `ratio`: distances of
    /// analyser and detector from the source.
    #[must_use]
    pub fn pixel_shift(&self, gap: f32, ratio: f32) -> f32 {
        self.displacement_x * (1.0 - ratio) - self.slope_x * gap * ratio
    }
}

/// Every shared struct, by topic.
pub const LAYOUTS: &[&[Layout]] =
    &[walk::LAYOUTS, light::LAYOUTS, fit::LAYOUTS, reconstruct::LAYOUTS, wave::LAYOUTS];

/// Address of a buffer on the device.
pub type Address = u64;

/// `trace_bundles.comp` holds a record in rows of a word per lane, three at most. It takes the word of a
/// lane's child from one row, so both words of such a field must be in the same row.
const _: () = {
    const LANES: usize = BUNDLE_LANES as usize;
    const fn in_one_row(offset: usize) -> bool {
        offset / 4 % LANES + 2 <= LANES
    }
    assert!(size_of::<Node>() <= 3 * 4 * LANES && size_of::<Leaf>() <= 3 * 4 * LANES);
    assert!(size_of::<Surface>() <= 4 * LANES);
    assert!(size_of::<Placed>() <= 3 * 4 * LANES);
    assert!(in_one_row(offset_of!(Node, meta)));
    assert!(in_one_row(offset_of!(Node, min_x)) && in_one_row(offset_of!(Node, max_x)));
    assert!(in_one_row(offset_of!(Node, min_y)) && in_one_row(offset_of!(Node, max_y)));
    assert!(in_one_row(offset_of!(Node, min_z)) && in_one_row(offset_of!(Node, max_z)));
};
