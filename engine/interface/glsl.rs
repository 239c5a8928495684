//! The table of shared structs and constants as GLSL. Part of the build script alone: the same
//! files that make Rust items in the library make text here.

use std::collections::BTreeMap;
use std::fmt::Write as _;

/// A shared struct as the table spells it.
pub(super) struct Struct {
    name: &'static str,
    /// Buffer references to arrays of it: name and access.
    buffers: Vec<(&'static str, &'static str)>,
    /// Name, Rust type, and the GLSL type where it does not follow from that.
    fields: Vec<(&'static str, &'static str, &'static str)>,
}

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
        pub(super) fn structs() -> Vec<super::Struct> {
            vec![ $( super::Struct {
                name: stringify!($name),
                buffers: vec![ $( $( (stringify!($buffer), concat!($( stringify!($access) )?)), )+ )? ],
                fields: vec![
                    $( (stringify!($field), stringify!($type), concat!($( stringify!($glsl) )?)), )*
                ],
            }, )* ]
        }
    };
}

macro_rules! shared_constants {
    ($( $(#[$attribute:meta])* $name:ident: $type:ty = $value:expr; )*) => {
        $( const $name: $type = $value; )*

        /// Name, Rust type and value of each.
        pub(super) fn constants() -> Vec<(&'static str, &'static str, String)> {
            vec![ $( (stringify!($name), stringify!($type), format!("{:?}", $name)), )* ]
        }
    };
}

#[path = "constants.rs"]
mod constants;
#[path = "fit.rs"]
mod fit;
#[path = "light.rs"]
mod light;
#[path = "reconstruct.rs"]
mod reconstruct;
#[path = "walk.rs"]
mod walk;

/// Buffer references to arrays of numbers: name, type, access.
const NUMBERS: [(&str, &str, &str); 10] = [
    ("Words", "uint", ""),
    ("Floats", "float", ""),
    ("ObjectMaterials", "uint", "readonly"),
    ("Neighbours", "uint", "readonly"),
    ("Partners", "uint", "readonly"),
    ("CornerNormals", "float", "readonly"),
    ("Offsets", "float", "readonly"),
    ("Curves", "float", "readonly"),
    ("Fits", "float", "writeonly"),
    ("Projections", "float", "readonly"),
];

/// The files that shaders include, by the name in their `#include`.
pub(crate) fn files() -> BTreeMap<String, String> {
    let mut files = BTreeMap::new();
    let mut all = String::new();
    for (name, rust, value) in constants::constants() {
        let number = match rust {
            "u32" | "usize" => format!("const uint {name} = {value}u;"),
            "f64" => format!("const float {name} = {value};"),
            other => panic!("constant {name}: no GLSL type for {other}"),
        };
        line(&mut all, &number);
    }
    for (name, element, access) in NUMBERS {
        line(&mut all, &reference(name, element, access, 4));
    }
    let structs: Vec<Struct> =
        [walk::structs(), light::structs(), fit::structs(), reconstruct::structs()]
            .into_iter()
            .flatten()
            .collect();
    for shared in &structs {
        if shared.name.ends_with("Push") {
            let head = format!("layout(push_constant, scalar) uniform {}", shared.name);
            let block = format!("{head} {{\n{}}} push;\n", members(shared));
            files.insert(format!("interface/{}.glsl", shared.name), block);
            continue;
        }
        line(&mut all, &format!("struct {} {{\n{}}};", shared.name, members(shared)));
        // References are 8 bytes, aligned to 8.
        let align = if shared.fields.iter().any(|field| !field.2.is_empty()) { 8 } else { 4 };
        for (name, access) in &shared.buffers {
            line(&mut all, &reference(name, shared.name, access, align));
        }
        let prefix = upper(shared.name);
        let mut at = 0;
        for (field, rust, _) in &shared.fields {
            line(&mut all, &format!("const uint {prefix}_{} = {at}u;", field.to_uppercase()));
            at += words(rust, &structs);
        }
        line(&mut all, &format!("const uint {prefix}_WORDS = {at}u;"));
    }
    files.insert("interface.glsl".into(), all);
    files
}

fn line(text: &mut String, add: &str) {
    writeln!(text, "{add}").expect("a string grows");
}

fn reference(name: &str, element: &str, access: &str, align: u32) -> String {
    format!(
        "layout(buffer_reference, scalar, buffer_reference_align = {align}) {access} buffer {name} \
         {{ {element} at[]; }};"
    )
}

fn members(shared: &Struct) -> String {
    let member = |(name, rust, glsl): &(&str, &str, &str)| match (*rust, *glsl) {
        ("f32", "") => format!("    float {name};\n"),
        ("u32", "") => format!("    uint {name};\n"),
        ("i32", "") => format!("    int {name};\n"),
        ("u64", "") => format!("    uvec2 {name};\n"),
        ("[f32; 3]", "") => format!("    vec3 {name};\n"),
        ("[f32; 4]", "") => format!("    vec4 {name};\n"),
        ("[u32; 2]", "") => format!("    uint {name}[2];\n"),
        (other, "") => format!("    {other} {name};\n"),
        (_, glsl) => format!("    {glsl} {name};\n"),
    };
    shared.fields.iter().map(member).collect()
}

/// Words of a field.
fn words(rust: &str, structs: &[Struct]) -> usize {
    match rust {
        "f32" | "u32" | "i32" => 1,
        "u64" | "[u32; 2]" => 2,
        "[f32; 3]" => 3,
        "[f32; 4]" => 4,
        name => {
            let shared = structs.iter().find(|shared| shared.name == name);
            let shared = shared.unwrap_or_else(|| panic!("no shared struct {name}"));
            shared.fields.iter().map(|field| words(field.1, structs)).sum()
        }
    }
}

/// `SurfaceCrossing` becomes `MET_SURFACE`.
fn upper(name: &str) -> String {
    let mut upper = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() && !upper.is_empty() {
            upper.push('_');
        }
        upper.extend(letter.to_uppercase());
    }
    upper
}
