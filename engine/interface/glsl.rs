//! The table of shared structs and constants as GLSL, for the build script.

use super::{Field, LAYOUTS, Layout, constants};
use std::collections::BTreeMap;
use std::fmt::Write as _;

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
///
/// # Panics
///
/// Where a type of the table has none that GLSL knows.
#[must_use]
pub fn glsl_files() -> BTreeMap<String, String> {
    let mut files = BTreeMap::new();
    let mut all = String::new();
    for (name, rust, value) in constants() {
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
    for shared in LAYOUTS.iter().copied().flatten() {
        if shared.name.ends_with("Push") {
            let head = format!("layout(push_constant, scalar) uniform {}", shared.name);
            let block = format!("{head} {{\n{}}} push;\n", members(shared));
            files.insert(format!("interface/{}.glsl", shared.name), block);
            continue;
        }
        line(&mut all, &format!("struct {} {{\n{}}};", shared.name, members(shared)));
        // References are 8 bytes, aligned to 8.
        let align = if shared.fields.iter().any(|field| field.glsl.is_some()) { 8 } else { 4 };
        for (name, access) in shared.buffers {
            line(&mut all, &reference(name, shared.name, access, align));
        }
        let prefix = upper(shared.name);
        for field in shared.fields {
            let name = field.name.to_uppercase();
            line(&mut all, &format!("const uint {prefix}_{name} = {}u;", field.offset / 4));
        }
        line(&mut all, &format!("const uint {prefix}_WORDS = {}u;", shared.size / 4));
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

fn members(shared: &Layout) -> String {
    let member = |field: &Field| {
        let name = field.name;
        match field.glsl.unwrap_or(field.rust) {
            "f32" => format!("    float {name};\n"),
            "u32" => format!("    uint {name};\n"),
            "i32" => format!("    int {name};\n"),
            "u64" => format!("    uvec2 {name};\n"),
            "[f32; 3]" => format!("    vec3 {name};\n"),
            "[f32; 4]" => format!("    vec4 {name};\n"),
            "[u32; 2]" => format!("    uint {name}[2];\n"),
            other => format!("    {other} {name};\n"),
        }
    };
    shared.fields.iter().map(member).collect()
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
