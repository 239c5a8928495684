//! Compares the structs that kernels and host share: names, offsets and sizes, as compiled. And looks
//! for casts between references.

use beamlet::internals::gpu::shaders;
use beamlet::internals::interface;
use beamlet::shared_structs;
use std::collections::{HashMap, HashSet};

mod test_shaders {
    #![allow(missing_docs, dead_code, unreachable_pub, reason = "generated")]
    include!(concat!(env!("OUT_DIR"), "/test_shaders.rs"));
}

/// Parts of a SPIR-V module that the comparison needs.
#[derive(Default)]
struct Module {
    names: HashMap<u32, String>,
    member_names: HashMap<(u32, u32), String>,
    offsets: HashMap<(u32, u32), usize>,
    matrix_strides: HashMap<(u32, u32), usize>,
    array_strides: HashMap<u32, usize>,
    constants: HashMap<u32, usize>,
    types: HashMap<u32, Type>,
}

enum Type {
    Scalar(usize),
    Vector(u32, usize),
    Matrix(usize),
    Array(u32, Option<u32>),
    Struct(Vec<u32>),
    Pointer,
}

fn text(words: &[u32]) -> String {
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    String::from_utf8(bytes.into_iter().take_while(|&b| b != 0).collect()).unwrap()
}

impl Module {
    fn parse(spirv: &[u32]) -> Self {
        let mut module = Self::default();
        let mut rest = &spirv[5..];
        while let Some(&first) = rest.first() {
            let (instruction, after) = rest.split_at((first >> 16) as usize);
            let word = |i: usize| instruction[i];
            let size = |i: usize| instruction[i] as usize;
            match first & 0xffff {
                5 => drop(module.names.insert(word(1), text(&instruction[2..]))),
                6 => drop(module.member_names.insert((word(1), word(2)), text(&instruction[3..]))),
                71 if word(2) == 6 => drop(module.array_strides.insert(word(1), size(3))),
                72 if word(3) == 7 => {
                    module.matrix_strides.insert((word(1), word(2)), size(4));
                }
                72 if word(3) == 35 => drop(module.offsets.insert((word(1), word(2)), size(4))),
                43 => drop(module.constants.insert(word(2), size(3))),
                21 | 22 => drop(module.types.insert(word(1), Type::Scalar(size(2) / 8))),
                23 => drop(module.types.insert(word(1), Type::Vector(word(2), size(3)))),
                24 => drop(module.types.insert(word(1), Type::Matrix(size(3)))),
                28 => drop(module.types.insert(word(1), Type::Array(word(2), Some(word(3))))),
                29 => drop(module.types.insert(word(1), Type::Array(word(2), None))),
                30 => drop(module.types.insert(word(1), Type::Struct(instruction[2..].to_vec()))),
                32 => drop(module.types.insert(word(1), Type::Pointer)),
                39 => drop(module.types.entry(word(1)).or_insert(Type::Pointer)),
                _ => {}
            }
            rest = after;
        }
        module
    }

    /// Size in bytes of a type as member `place` (struct, index); `None` for run-time arrays.
    fn size(&self, id: u32, place: (u32, u32)) -> Option<usize> {
        Some(match self.types.get(&id)? {
            Type::Scalar(bytes) => *bytes,
            Type::Vector(scalar, count) => self.size(*scalar, place)? * count,
            Type::Matrix(columns) => self.matrix_strides.get(&place)? * columns,
            Type::Array(_, length) => {
                self.array_strides.get(&id)? * self.constants.get(length.as_ref()?)?
            }
            Type::Struct(members) => {
                let last = u32::try_from(members.len()).unwrap() - 1;
                self.offsets.get(&(id, last))? + self.size(members[last as usize], (id, last))?
            }
            Type::Pointer => 8,
        })
    }

    /// Compares every struct that lies in memory with its twin.
    fn compare(&self, twins: &[interface::Layout]) -> Vec<String> {
        let mut problems = Vec::new();
        for (&id, kind) in &self.types {
            let name = self.names.get(&id).map_or("", String::as_str);
            match kind {
                // A block that only wraps a run-time array has no twin; its element has.
                Type::Struct(members)
                    if self.offsets.contains_key(&(id, 0))
                        && !matches!(self.types.get(&members[0]), Some(Type::Array(_, None))) =>
                {
                    match twins.iter().find(|twin| twin.name == name) {
                        Some(twin) => self.compare_one(id, members, twin, &mut problems),
                        None => problems.push(format!("{name}: no twin on the host")),
                    }
                }
                Type::Array(element, _) => self.compare_stride(id, *element, twins, &mut problems),
                _ => {}
            }
        }
        problems
    }

    fn compare_one(
        &self,
        id: u32,
        members: &[u32],
        twin: &interface::Layout,
        problems: &mut Vec<String>,
    ) {
        let fields = |list: Vec<(String, usize, usize)>| {
            list.into_iter().map(|(name, at, size)| format!("{name} at {at}, {size} bytes"))
        };
        let compiled = members.iter().zip(0u32..).map(|(&member, i)| {
            let place = (id, i);
            (
                self.member_names.get(&place).cloned().unwrap_or_default(),
                self.offsets.get(&place).copied().unwrap_or(usize::MAX),
                self.size(member, place).unwrap_or(0),
            )
        });
        let host =
            twin.fields.iter().map(|field| (field.name.to_owned(), field.offset, field.size));
        let compiled: Vec<_> = fields(compiled.collect()).collect();
        let host: Vec<_> = fields(host.collect()).collect();
        for i in 0..compiled.len().max(host.len()) {
            let (compiled, host) = (compiled.get(i), host.get(i));
            if compiled != host {
                let show = |field: Option<&String>| field.map_or("nothing".into(), String::clone);
                let (compiled, host) = (show(compiled), show(host));
                problems.push(format!("{}: shader has {compiled}; host has {host}", twin.name));
            }
        }
    }

    /// Elements of an array in memory lie as close as they do on the host.
    fn compare_stride(
        &self,
        id: u32,
        element: u32,
        twins: &[interface::Layout],
        problems: &mut Vec<String>,
    ) {
        let Some(&stride) = self.array_strides.get(&id) else { return };
        let name = self.names.get(&element).map_or("array element", String::as_str);
        let twin = twins.iter().find(|twin| twin.name == name).map(|twin| twin.size);
        if let Some(size) = twin.or_else(|| self.size(element, (0, 0)))
            && size != stride
        {
            problems.push(format!("{name}: stride {stride} in the shader, {size} on the host"));
        }
    }
}

#[test]
fn every_shared_struct_has_the_same_layout_on_both_sides() {
    let twins = interface::LAYOUTS.concat();
    let problems: Vec<_> = shaders::ALL
        .iter()
        .flat_map(|(shader, spirv)| {
            let problems = Module::parse(spirv).compare(&twins);
            problems.into_iter().map(move |problem| format!("{shader}: {problem}"))
        })
        .collect();
    assert!(problems.is_empty(), "{}", problems.join("\n"));
}

/// Casts of references to references in a SPIR-V module.
fn reference_casts(spirv: &[u32]) -> usize {
    const TYPES: std::ops::RangeInclusive<u32> = 19..=39;
    const POINTER: u32 = 32;
    const DECORATIONS: std::ops::RangeInclusive<u32> = 71..=75;
    const CAST: u32 = 124;
    /// Storage class of memory that is reached by its address.
    const BY_ADDRESS: u32 = 5349;
    let mut types = HashSet::new();
    let mut references = HashSet::new();
    // Values and their types.
    let mut values = HashMap::new();
    let mut casts = 0;
    let mut rest = &spirv[5..];
    while let Some(&first) = rest.first() {
        let (instruction, after) = rest.split_at((first >> 16) as usize);
        match (first & 0xffff, &instruction[1..]) {
            (code, [id, of @ ..]) if TYPES.contains(&code) => {
                types.insert(*id);
                if code == POINTER && of[0] == BY_ADDRESS {
                    references.insert(*id);
                }
            }
            (code, [kind, id, of @ ..]) if types.contains(kind) && !DECORATIONS.contains(&code) => {
                let is_reference =
                    |value| values.get(value).is_some_and(|kind| references.contains(kind));
                let is_cast = code == CAST && references.contains(kind) && is_reference(&of[0]);
                casts += usize::from(is_cast);
                values.insert(*id, *kind);
            }
            _ => {}
        }
        rest = after;
    }
    casts
}

/// `SwiftShader` ends the process where a kernel has one.
#[test]
fn no_kernel_casts_a_reference_to_a_reference() {
    assert_eq!(reference_casts(test_shaders::CAST), 1, "the cast of the test is not found");
    assert!(shaders::ALL.len() > 20);
    let casts = |(name, spirv): &(&'static str, &[u32])| (*name, reference_casts(spirv));
    let with: Vec<_> = shaders::ALL.iter().map(casts).filter(|(_, casts)| *casts > 0).collect();
    assert!(with.is_empty(), "{with:?}");
}

shared_structs! {
    /// Right twins of tests/device/shaders/fill.comp.
    RIGHT;
    struct Entry { index: u32, value: [f32; 3] }
    struct FillPush { entries: u64, count: u32, scale: f32 }
}

#[test]
fn right_twins_pass() {
    assert_eq!(Module::parse(test_shaders::FILL).compare(RIGHT), [""; 0]);
}

mod wrong {
    beamlet::shared_structs! {
        /// Twins of tests/device/shaders/fill.comp with a swap and an added field.
        pub(super) TWINS;
        struct Entry { value: [f32; 3], index: u32 }
        struct FillPush { entries: u64, count: u32, scale: f32, pad: [u32; 2] }
    }
}

#[test]
fn wrong_twins_are_named() {
    let mut problems = Module::parse(test_shaders::FILL).compare(wrong::TWINS);
    problems.sort();
    assert_eq!(
        problems,
        [
            "Entry: shader has index at 0, 4 bytes; host has value at 0, 12 bytes",
            "Entry: shader has value at 4, 12 bytes; host has index at 12, 4 bytes",
            "FillPush: shader has nothing; host has pad at 16, 8 bytes",
        ]
    );
    assert_eq!(
        Module::parse(test_shaders::FILL).compare(&RIGHT[..1]),
        ["FillPush: no twin on the host"]
    );
}
