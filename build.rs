//! Compiles the compute shaders to SPIR-V. A shader error ends the build with its file and line.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "cargo reads and shows both")]

use glslang::error::GlslangError;
use glslang::include::{IncludeHandler, IncludeResult, IncludeType};
use glslang::{
    Compiler, CompilerOptions, ShaderInput, ShaderMessage, ShaderSource, ShaderStage,
    SourceLanguage, SpirvVersion, Target, VulkanVersion,
};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs, process};

/// One compiled shader: its name, its file, and the macros defined for it.
type Permutation = (&'static str, &'static str, &'static [(&'static str, &'static str)]);

/// The shaders of the engine, from shaders/. `trace_bvh` becomes `gpu::shaders::TRACE_BVH`.
const PERMUTATIONS: &[Permutation] = &[
    ("trace_bvh", "trace.comp", &[("SUMS_IN_REGISTERS", "1")]),
    ("trace_bvh_many", "trace.comp", &[]),
    ("trace_bvh_placed", "trace.comp", &[("SUMS_IN_REGISTERS", "1"), ("PLACED", "1")]),
    ("trace_bvh_placed_many", "trace.comp", &[("PLACED", "1")]),
    ("trace_bundles", "trace_bundles.comp", &[("SUMS_IN_REGISTERS", "1")]),
    ("trace_bundles_many", "trace_bundles.comp", &[]),
    ("trace_bundles_placed", "trace_bundles.comp", &[("SUMS_IN_REGISTERS", "1"), ("PLACED", "1")]),
    ("trace_bundles_placed_many", "trace_bundles.comp", &[("PLACED", "1")]),
    ("trace_ray_query", "trace.comp", &[("BACKEND_RAY_QUERY", "1"), ("SUMS_IN_REGISTERS", "1")]),
    ("trace_ray_query_many", "trace.comp", &[("BACKEND_RAY_QUERY", "1")]),
    (
        "trace_ray_query_placed",
        "trace.comp",
        &[("BACKEND_RAY_QUERY", "1"), ("SUMS_IN_REGISTERS", "1"), ("PLACED", "1")],
    ),
    ("trace_ray_query_placed_many", "trace.comp", &[("BACKEND_RAY_QUERY", "1"), ("PLACED", "1")]),
    ("exact_bvh", "exact.comp", &[]),
    ("exact_bvh_placed", "exact.comp", &[("PLACED", "1")]),
    ("exact_ray_query", "exact.comp", &[("BACKEND_RAY_QUERY", "1")]),
    ("exact_ray_query_placed", "exact.comp", &[("BACKEND_RAY_QUERY", "1"), ("PLACED", "1")]),
    ("crossings", "crossings.comp", &[("PLACED", "1")]),
    ("illuminate", "illuminate.comp", &[]),
    ("illuminate_far", "illuminate.comp", &[("FAR", "1")]),
    ("illuminate_walls", "illuminate.comp", &[("WALLS", "1"), ("FAR", "1")]),
    ("illuminate_heights", "illuminate.comp", &[("HEIGHTS", "1")]),
    ("energies", "light/energies.comp", &[]),
    ("gather", "light/gather.comp", &[]),
    ("random_rays", "random_rays.comp", &[]),
    ("random_light", "random_light.comp", &[]),
    ("random_light_walls", "random_light.comp", &[("WALLS", "1")]),
    ("random_light_heights", "random_light.comp", &[("HEIGHTS", "1")]),
    ("wave_field", "wave/field.comp", &[]),
    ("wave_line", "wave/line.comp", &[]),
    ("fit", "retrieve/fit.comp", &[]),
    ("back_project", "reconstruct/back_project.comp", &[]),
    ("project", "reconstruct/project.comp", &[]),
    ("project_cone", "reconstruct/project.comp", &[("CONE", "1")]),
    ("project_back", "reconstruct/project_back.comp", &[]),
    ("project_back_cone", "reconstruct/project_back.comp", &[("CONE", "1")]),
    ("project_moved", "reconstruct/project_moved.comp", &[]),
    ("project_back_moved", "reconstruct/project_back_moved.comp", &[]),
    ("sinogram", "reconstruct/sinogram.comp", &[]),
    ("sinogram_back", "reconstruct/sinogram.comp", &[("BACK", "1")]),
    ("combine", "reconstruct/combine.comp", &[]),
    ("dot", "reconstruct/dot.comp", &[]),
    ("fourier", "reconstruct/fourier.comp", &[]),
];

/// The shaders of the tests, from tests/device/shaders/; they are not part of the library.
const TEST_PERMUTATIONS: &[Permutation] = &[
    ("fill", "fill.comp", &[]),
    ("fill_twice", "fill.comp", &[("FACTOR", "2")]),
    ("crossings", "crossings.comp", &[]),
    ("cast", "cast.comp", &[]),
];

/// Every `#include` is found from this folder, whichever file asks.
const ROOT: &str = "shaders";
const TEST_ROOT: &str = "tests/device/shaders";

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let interface = beamlet_interface::glsl_files();
    for (name, text) in &interface {
        // For readers: shaders get the text from here.
        let path = out.join(name);
        fs::create_dir_all(path.parent().expect("a file has a folder"))
            .expect("OUT_DIR can be written");
        fs::write(path, text).expect("OUT_DIR can be written");
    }
    if let Some(commit) = commit(&out) {
        println!("cargo::rustc-env=BEAMLET_COMMIT={commit}");
    }
    build_all(ROOT, PERMUTATIONS, &interface, &out, "shaders.rs");
    // A package from a registry may come without its tests.
    let tests = if Path::new(TEST_ROOT).is_dir() { TEST_PERMUTATIONS } else { &[] };
    build_all(TEST_ROOT, tests, &interface, &out, "test_shaders.rs");
}

/// The commit that is checked out, for the record of runs; `None` in a package, also where that lies
/// in a repository of others. Builds for development go without it, or each commit would build all anew:
/// those in folders other than `release`, and those with `CARGO_INCREMENTAL=1`.
fn commit(out: &Path) -> Option<String> {
    println!("cargo::rerun-if-env-changed=CARGO_INCREMENTAL");
    let is_incremental = env::var("CARGO_INCREMENTAL").is_ok_and(|value| value == "1");
    // OUT_DIR is PROFILE/build/PACKAGE/out.
    if is_incremental || out.ancestors().nth(3)?.file_name()? != "release" {
        return None;
    }
    let root = env::var_os("CARGO_MANIFEST_DIR")?;
    let git = |words: &[&str]| {
        let output = process::Command::new("git").current_dir(&root).args(words).output().ok()?;
        let text = String::from_utf8(output.stdout).ok()?;
        output.status.success().then(|| text.trim().to_owned())
    };
    let top = git(&["rev-parse", "--show-toplevel"])?;
    if Path::new(&top).canonicalize().ok()? != Path::new(&root).canonicalize().ok()? {
        return None;
    }
    // Written whenever another commit is checked out or made.
    println!("cargo::rerun-if-changed={}", git(&["rev-parse", "--git-path", "logs/HEAD"])?);
    git(&["rev-parse", "HEAD"])
}

/// Compiles a table of permutations and writes the words as Rust constants.
fn build_all(
    folder: &str,
    permutations: &[Permutation],
    interface: &BTreeMap<String, String>,
    out: &Path,
    generated: &str,
) {
    if Path::new(folder).is_dir() {
        println!("cargo::rerun-if-changed={folder}");
    }
    let (mut rust, mut all, mut failed) = (String::new(), String::new(), false);
    for (name, file, defines) in permutations {
        let words = match compile(folder, file, defines, interface) {
            Ok(words) => words,
            Err(message) => {
                eprintln!("shader {name}:\n{message}");
                failed = true;
                continue;
            }
        };
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        fs::write(out.join(format!("{name}.spv")), bytes).expect("OUT_DIR can be written");
        let constant = name.to_uppercase();
        write!(
            rust,
            "/// SPIR-V of `{folder}/{file}` `{defines:?}`.\npub const {constant}: &[u32] = &["
        )
        .expect("a string grows");
        for word in &words {
            write!(rust, "{word:#x},").expect("a string grows");
        }
        rust.push_str("];\n");
        write!(all, "({name:?}, {constant}),").expect("a string grows");
    }
    if failed {
        process::exit(1);
    }
    write!(rust, "/// Every shader by name.\npub const ALL: &[(&str, &[u32])] = &[{all}];\n")
        .expect("a string grows");
    fs::write(out.join(generated), rust).expect("OUT_DIR can be written");
}

fn compile(
    folder: &str,
    file: &str,
    defines: &[(&str, &str)],
    interface: &BTreeMap<String, String>,
) -> Result<Vec<u32>, String> {
    let path = Path::new(folder).join(file);
    let text = fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
    let source = ShaderSource::from(with_defines(&path, &text, defines));
    let options = CompilerOptions {
        source_language: SourceLanguage::GLSL,
        target: Target::Vulkan {
            version: VulkanVersion::Vulkan1_2,
            spirv_version: SpirvVersion::SPIRV1_5,
        },
        version_profile: None,
        messages: ShaderMessage::DEFAULT,
    };
    let compiler = Compiler::acquire().expect("glslang starts");
    let mut includes = Includes(interface);
    let no_defines: Option<&[(&str, Option<&str>)]> = None;
    ShaderInput::new(&source, ShaderStage::Compute, &options, no_defines, Some(&mut includes))
        .and_then(|input| compiler.create_shader(input))
        .and_then(|shader| shader.compile())
        .map_err(|error| readable(&error))
}

/// The beginning of every shader.
const HEAD: &str = "#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
";

/// Puts head and macros before a shader; `#line` keeps file and line of later messages.
fn with_defines(path: &Path, text: &str, defines: &[(&str, &str)]) -> String {
    let macros = defines.iter().map(|(name, value)| format!("#define {name} {value}\n"));
    format!("{HEAD}{}#line 1 \"{}\"\n{text}", macros.collect::<String>(), path.display())
}

/// The messages of glslang, one per line, as `file:line: message`.
fn readable(error: &GlslangError) -> String {
    let (GlslangError::ParseError(log) | GlslangError::LinkError(log)) = error else {
        return error.to_string();
    };
    let summary = |line: &str| {
        line.contains("compilation errors")
            || line.contains("compilation terminated")
            || line.is_empty()
    };
    log.log
        .lines()
        .filter(|line| !summary(line.trim()))
        .map(|line| line.strip_prefix("ERROR: ").unwrap_or(line))
        .collect::<Vec<_>>()
        .join("\n")
}

/// Finds included files: those made of the shared table, or below [`ROOT`].
struct Includes<'a>(&'a BTreeMap<String, String>);

impl IncludeHandler for Includes<'_> {
    fn include(
        &mut self,
        _: IncludeType,
        header: &str,
        _includer: &str,
        _depth: usize,
    ) -> Option<IncludeResult> {
        if let Some(data) = self.0.get(header) {
            return Some(IncludeResult { name: header.to_owned(), data: data.clone() });
        }
        let path = Path::new(ROOT).join(header);
        let data = fs::read_to_string(&path).ok()?;
        Some(IncludeResult { name: path.display().to_string(), data })
    }
}
