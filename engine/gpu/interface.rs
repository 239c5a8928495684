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
            #[repr(C)]
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

shared_structs! {
    /// Every shared struct.
    pub LAYOUTS;
}
