//! Twins of the structs that kernels and host share. The GLSL side is shaders/interface.glsl, in
//! `scalar` layout; tests/interface.rs compares both in every compiled shader.

/// How the host lays out a struct that it shares with kernels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Name of the struct or block, the same in GLSL.
    pub name: &'static str,
    /// Size in bytes: the stride of an array of them.
    pub size: usize,
    /// Name, byte offset and size in bytes of each field, in order.
    pub fields: &'static [(&'static str, usize, usize)],
}

/// Declares structs shared with kernels (`#[repr(C)]`, `Pod`) and a table `$table` of their
/// layouts. Names of structs and fields are those of the GLSL side.
#[macro_export]
#[doc(hidden)]
macro_rules! shared_structs {
    (
        $(#[$table_attribute:meta])* $table_visibility:vis $table:ident;
        $(
            $(#[$attribute:meta])*
            $visibility:vis struct $name:ident {
                $( $(#[$field_attribute:meta])* $field_visibility:vis $field:ident: $type:ty ),* $(,)?
            }
        )*
    ) => {
        $(
            $(#[$attribute])*
            #[derive(Debug, Clone, Copy, PartialEq, ::bytemuck::Pod, ::bytemuck::Zeroable)]
            // Addresses come first in every struct; packing spares them tail padding.
            #[repr(C, packed(4))]
            #[allow(missing_docs, reason = "the GLSL side describes the fields")]
            $visibility struct $name {
                $( $(#[$field_attribute])* $field_visibility $field: $type, )*
            }
        )*
        $(#[$table_attribute])*
        $table_visibility const $table: &[$crate::gpu::interface::Layout] = &[
            $( $crate::gpu::interface::Layout {
                name: stringify!($name),
                size: ::core::mem::size_of::<$name>(),
                fields: &[ $( (
                    stringify!($field),
                    ::core::mem::offset_of!($name, $field),
                    ::core::mem::size_of::<$type>(),
                ), )* ],
            }, )*
        ];
    };
}

/// Address of a buffer on the device.
pub type Address = u64;

shared_structs! {
    /// Every shared struct.
    pub LAYOUTS;
    /// A straight line through (x, z) in the plane y = 0 of the beam frame of a view.
    pub struct Ray {
        pub x: f32,
        pub z: f32,
        pub slope_x: f32,
        pub slope_z: f32,
        pub view: u32,
    }

    /// Beam frame of a view.
    pub struct View {
        pub cos_angle: f32,
        pub sin_angle: f32,
        pub start: f32,
        pub analyser: f32,
    }

    /// A leaf of the BVH.
    pub struct Leaf {
        pub a: [f32; 3],
        pub b: [f32; 3],
        pub c: [f32; 3],
        pub normal: [f32; 3],
        pub surface: u32,
    }

    /// The two sides of a connected surface.
    pub struct Surface {
        pub object: u32,
        pub inside: u32,
        pub outside: u32,
        pub hash: u32,
        pub grazing: f32,
    }

    /// Optical constants of a material at one energy node.
    pub struct Constants {
        pub mu: f32,
        pub delta: f32,
    }

    /// Compressed wide BVH node.
    pub struct Node {
        pub origin: [f32; 3],
        pub exponents: u32,
        pub child_base: u32,
        pub leaf_base: u32,
        pub meta: [u32; 2],
        pub min_x: [u32; 2],
        pub max_x: [u32; 2],
        pub min_y: [u32; 2],
        pub max_y: [u32; 2],
        pub min_z: [u32; 2],
        pub max_z: [u32; 2],
    }

    /// Optical depth and deflection of a ray at one energy.
    pub struct Law {
        pub optical_depth: f32,
        pub displacement_x: f32,
        pub displacement_z: f32,
        pub slope_x: f32,
        pub slope_z: f32,
        pub signature: u32,
        pub flags: u32,
        pub crossings: u32,
    }

    /// A crossing of a straight ray, on its list.
    pub struct Crossing {
        pub y: f32,
        pub facet: u32,
    }

    /// A crossing of a ray with a surface of the sample.
    pub struct MetSurface {
        /// Along the optical axis in the beam frame, m.
        pub y: f32,
        /// Index of the object whose surface it is.
        pub object: u32,
        /// 1 where the ray goes into the object, 0 where it leaves it.
        pub entering: u32,
        /// Unit normal, away from the object's material, beam frame.
        pub normal: [f32; 3],
    }

    /// The sample on the device.
    pub struct Sample {
        pub nodes: Address,
        pub leaves: Address,
        pub surfaces: Address,
        pub constants: Address,
        pub object_materials: Address,
        pub acceleration: Address,
        pub views: Address,
        pub neighbours: Address,
    }

    /// An open interval of a mask.
    pub struct Aperture {
        pub low: f32,
        pub high: f32,
    }

    /// A mask as the light stages see it.
    pub struct Mask {
        pub apertures: Address,
        pub count: u32,
        pub present: u32,
        pub period: f32,
        pub thickness: f32,
        pub attenuation: f32,
        pub transmission: f32,
        pub averaged: u32,
        pub softness: f32,
        pub first: f32,
        pub last: f32,
    }

    /// What depends on the beamlet alone.
    pub struct Column {
        pub pixel: i32,
        pub pixel_offset: f32,
        pub aperture_offset: f32,
        pub sample_offset: f32,
        pub slope: f32,
    }

    /// Cells of one beamlet in one interval of z.
    pub struct Strip {
        pub first: u32,
        pub count: u32,
        pub column: u32,
        pub row: i32,
        pub top: f32,
        pub bottom: f32,
        pub rows: u32,
        pub light: f32,
        pub low_landing: f32,
        pub high_landing: f32,
        pub spread: f32,
        pub bend: f32,
    }

    /// A cell with the laws at its ends.
    pub struct Cell {
        pub x_low: f32,
        pub x_high: f32,
        pub depth_low: f32,
        pub depth_high: f32,
        pub displacement_low: f32,
        pub displacement_high: f32,
        pub displacement_z: f32,
        pub above: f32,
        pub below: f32,
        pub pixel_shift: f32,
        pub spread: f32,
        pub sample_shade: f32,
        pub detector_shade: f32,
        pub sample_lean: f32,
        pub detector_lean: f32,
    }

    /// A Gaussian of the focal spot.
    pub struct SpotPart {
        pub below: f32,
        pub x: f32,
        pub z: f32,
        pub deviation_x: f32,
        pub deviation_z: f32,
    }

    /// Everything that the light stages need to know of a band.
    pub struct Light {
        pub sample_mask: Mask,
        pub detector_mask: Mask,
        pub columns: Address,
        pub offsets: Address,
        pub spot_parts: Address,
        pub magnification: f32,
        pub mask_move: f32,
        pub landing_move: f32,
        pub pixel_move: f32,
        pub slope_move: f32,
        pub row_move: f32,
        pub spot: f32,
        pub pixel_spot: f32,
        pub shift: f32,
        pub cell_plane: f32,
        pub analyser: f32,
        pub ratio: f32,
        pub pixel: f32,
        pub weight: f32,
        pub row_blur: f32,
        pub row_pitch: f32,
        pub row_slope: f32,
        pub middle_row: f32,
        pub alike_rows: f32,
        pub row_count: u32,
        pub first_row: i32,
        pub column_count: u32,
        pub detector: f32,
        pub rotation: f32,
        pub column_pitch: f32,
        pub part: f32,
    }

    /// A pixel of the random scheme.
    pub struct Pixel {
        pub column: i32,
        pub row: i32,
        pub table: u32,
    }

    /// Push constants of `trace.comp`.
    pub struct TracePush {
        pub sample_ref: Address,
        pub rays: Address,
        pub moments: Address,
        pub laws: Address,
        pub exact: Address,
        pub unbalanced: Address,
        pub list: Address,
        pub tally: Address,
        pub count: u32,
        pub materials: u32,
        pub listed: u32,
        pub last: u32,
        pub nudge: f32,
    }

    /// Push constants of `exact.comp`.
    pub struct ExactPush {
        pub sample_ref: Address,
        pub rays: Address,
        pub laws: Address,
        pub list: Address,
        pub unbalanced: Address,
        pub longer: Address,
        pub lists: Address,
        pub nodes: Address,
        pub tally: Address,
        pub count: u32,
        pub all: u32,
        pub runs: u32,
        pub first: u32,
        pub last: u32,
        pub nudge: f32,
        pub capacity: u32,
        pub stride: u32,
    }

    /// Push constants of `crossings.comp`.
    pub struct CrossingsPush {
        pub sample_ref: Address,
        pub rays: Address,
        pub met: Address,
        pub counts: Address,
        pub lists: Address,
        pub count: u32,
        pub first: u32,
        pub capacity: u32,
        pub stride: u32,
    }

    /// Push constants of `illuminate.comp`.
    pub struct IlluminatePush {
        pub light_ref: Address,
        pub strips: Address,
        pub cells: Address,
        pub sums: Address,
        pub strip_count: u32,
        pub first_strip: u32,
        pub first_step: u32,
        pub last_step: u32,
        pub steps_each: u32,
        pub steps: u32,
    }

    /// Push constants of `random_rays.comp`.
    pub struct RandomRaysPush {
        pub light_ref: Address,
        pub pixels: Address,
        pub rays: Address,
        pub seed: [u32; 2],
        pub rays_per_pixel: [u32; 2],
        pub first_ray: u32,
        pub batch: u32,
        pub pixel_count: u32,
        pub view: u32,
        pub view_seed: u32,
    }

    /// Push constants of `random_light.comp`.
    pub struct RandomLightPush {
        pub light_ref: Address,
        pub pixels: Address,
        pub laws: Address,
        pub sums: Address,
        pub seed: [u32; 2],
        pub rays_per_pixel: [u32; 2],
        pub first_ray: u32,
        pub batch: u32,
        pub pixel_count: u32,
        pub view_seed: u32,
        pub empty: u32,
        pub first_step: u32,
    }

    /// A mask step of a fit.
    pub struct Step {
        pub offset: f32,
        pub offset_low: f32,
        pub width: f32,
    }

    /// Push constants of `retrieve/fit.comp`.
    pub struct FitPush {
        pub steps: Address,
        pub curves: Address,
        pub fits: Address,
        pub step_count: u32,
        pub pixel_count: u32,
        pub first: u32,
        pub poisson: u32,
        pub gain: f32,
        pub saturation: f32,
        pub narrow: f32,
        pub wide: f32,
    }
}

/// Version of the moments layout below.
pub const MOMENTS_VERSION: u32 = 1;
/// Words at the head of a ray's moments: signature, balance, flags, crossings.
pub const MOMENTS_HEAD: usize = 4;
/// Floats per material: path length, lever sums x and z, slope sums x and z.
pub const MOMENTS_PER_MATERIAL: usize = 5;
/// With more materials sums of rays are kept in memory even where nobody asks for moments.
pub const MATERIALS_IN_REGISTERS: u32 = 4;

/// The first order is not enough at some surface.
pub const FLAG_GRAZING: u32 = 1;
/// Traced in order.
pub const FLAG_EXACT: u32 = 2;
/// Totally reflected at least once.
pub const FLAG_REFLECTED: u32 = 4;
/// Entered and left some object unequally often.
pub const FLAG_UNBALANCED: u32 = 8;
/// A limit was met.
pub const FLAG_DROPPED: u32 = 16;
/// A value is not finite.
pub const FLAG_NOT_FINITE: u32 = 32;
/// The highest byte of a law's flags: least cosine of incidence over that below which the first
/// order is not enough, in 255ths.
pub const FLAG_SHARE_SHIFT: u32 = 24;

/// A number as the shaders hold it.
#[allow(clippy::cast_possible_truncation, reason = "rounding to f32 is meant")]
pub(crate) fn single(value: f64) -> f32 {
    value as f32
}
