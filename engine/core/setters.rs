//! The setters of option structs: fields are public, and `with_` methods set them in a chain, since
//! callers cannot write a struct that may gain fields as a literal.

/// Writes a `with_` method for fields of a struct: `/// Documentation. with_name(name: Type);`. A field
/// that is an `Option` takes the value itself or an `Option` by `name: impl Into<Option<…>>`.
#[macro_export]
macro_rules! setters {
    ($($(#[$attribute:meta])* $setter:ident($field:ident: $type:ty);)*) => {
        $(
            $(#[$attribute])*
            #[must_use]
            pub fn $setter(mut self, $field: $type) -> Self {
                self.$field = $field.into();
                self
            }
        )*
    };
}
