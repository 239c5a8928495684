//! The Vulkan wrapper on whatever device is there, under the validation layer where it is
//! installed. `BEAMLET_DEVICE` chooses the device.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "tests panic, and say what they skip"
)]

use crate::support::complete;
use beamlet::Error;
use beamlet::KernelCache;
use beamlet::internals::gpu::{AccelerationStructure, Device, DeviceKind, DeviceOptions, Memory};
use bytemuck::{Pod, Zeroable, bytes_of};
use std::process::Command;
use std::sync::Arc;

mod shaders {
    #![allow(missing_docs, dead_code, unreachable_pub, reason = "generated")]
    include!(concat!(env!("OUT_DIR"), "/test_shaders.rs"));
}

/// With validation where the layer is installed: a complete run has it.
pub(crate) fn open(staging: bool) -> Arc<Device> {
    let options = DeviceOptions { validation: true, staging, profile: true, ..Default::default() };
    match Device::open(&options) {
        Err(Error::Device { wanted, .. }) if wanted.contains("validation layer") => {
            assert!(!complete(), "no validation layer, and BEAMLET_COMPLETE is set");
            eprintln!("no validation layer: its messages are not checked");
            Device::open(&DeviceOptions { validation: false, ..options.clone() }).unwrap()
        }
        opened => opened.unwrap(),
    }
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct FillPush {
    entries: u64,
    count: u32,
    scale: f32,
}

#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
struct Entry {
    index: u32,
    value: [f32; 3],
}

fn fill_and_read(device: &Arc<Device>, memory: Memory) {
    let count = 10_000u32;
    let bytes = u64::from(count) * 16;
    let kernel = device.kernel_from("fill", shaders::FILL_TWICE, 16).unwrap();
    let entries = device.buffer("entries", bytes, memory).unwrap();
    let copy = device.buffer("copy", bytes, memory).unwrap();
    let push = FillPush { entries: entries.address(), count: count - 5, scale: 0.5 };
    device
        .run(|r| {
            r.fill(&entries, 0, bytes, 7);
            r.barrier();
            r.dispatch(&kernel, bytes_of(&push), [count.div_ceil(64), 1, 1]);
            r.barrier();
            r.copy(&entries, 0, &copy, 0, bytes);
        })
        .unwrap();
    let read: Vec<Entry> = copy.read(0, count as usize).unwrap();
    for (i, entry) in (0u16..).zip(&read).take(count as usize - 5) {
        let expected = Entry { index: u32::from(i) * 2, value: [f32::from(i) * 0.5, 1.0, 2.0] };
        assert_eq!(*entry, expected);
    }
    assert_eq!(bytemuck::cast_slice::<Entry, u32>(&read[count as usize - 5..]), [7; 20]);

    copy.write(32, &[1u32, 2, 3]).unwrap();
    let words: Vec<u32> = copy.read(28, 5).unwrap();
    assert_eq!(words[1..4], [1, 2, 3]);
}

#[test]
fn a_kernel_fills_and_the_host_reads_what_it_wrote() {
    for (staging, memory) in
        [(false, Memory::Device), (false, Memory::Host), (true, Memory::Device)]
    {
        let device = open(staging);
        fill_and_read(&device, memory);
        assert_eq!(device.validation_messages(), 0);
    }
}

#[test]
fn words_on_the_device_size_a_dispatch() {
    for staging in [false, true] {
        let device = open(staging);
        let kernel = device.kernel_from("fill", shaders::FILL, 16).unwrap();
        let entries = device.buffer("entries", 640 * 16, Memory::Device).unwrap();
        let groups = device.upload("groups", &[9_u32, 0, 1, 1]).unwrap();
        let push = FillPush { entries: entries.address(), count: 640, scale: 1.0 };
        let run = |x: u32| {
            device
                .run(|r| {
                    r.fill(&entries, 0, 640 * 16, 7);
                    r.fill(&groups, 4, 4, x);
                    r.barrier();
                    r.dispatch_indirect(&kernel, bytes_of(&push), &groups, 4);
                })
                .unwrap();
            device.count_indirect(&kernel, x.into());
            let words: Vec<u32> = entries.read(0, 640 * 4).unwrap();
            words.chunks(4).filter(|entry| **entry != [7; 4]).count()
        };
        assert_eq!([0, 3, 10].map(run), [0, 192, 640]);
        let counted = device.profile().kernels["fill"];
        assert_eq!([counted.dispatches, counted.groups, counted.largest], [2, 13, 10]);
        assert_eq!(device.validation_messages(), 0);
    }
}

/// Kernels from a file give what new ones give, and a damaged file is as none. Drivers that keep nothing
/// write no file.
#[test]
fn kept_kernels_work_as_new_ones_and_damaged_ones_are_ignored() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("kernels");
    let files = || {
        let entries = std::fs::read_dir(&path).into_iter().flatten();
        entries.map(|entry| entry.unwrap().path()).collect::<Vec<_>>()
    };
    let run = || {
        let options =
            DeviceOptions { cache: KernelCache::Folder(path.clone()), ..Default::default() };
        fill_and_read(&Device::open(&options).unwrap(), Memory::Device);
    };
    run();
    let written = files();
    run();
    assert_eq!(files(), written);
    for file in written {
        let whole = std::fs::read(&file).unwrap();
        for damaged in [&whole[..whole.len() / 2], &[], &[0xff; 4096]] {
            std::fs::write(&file, damaged).unwrap();
            run();
            assert!(std::fs::read(&file).unwrap().starts_with(b"blkern"));
        }
    }
}

#[test]
fn work_of_a_device_is_counted() {
    for staging in [false, true] {
        let device = open(staging);
        let kernel = device.kernel_from("fill", shaders::FILL, 16).unwrap();
        let entries = device.buffer("entries", 640 * 16, Memory::Device).unwrap();
        let push = FillPush { entries: entries.address(), count: 640, scale: 1.0 };
        device
            .run(|r| {
                for groups in [10, 0, 1] {
                    r.dispatch(&kernel, bytes_of(&push), [groups, 1, 1]);
                    r.barrier();
                }
            })
            .unwrap();
        entries.write(0, &[1_u32, 2]).unwrap();
        let _: Vec<u32> = entries.read(0, 5).unwrap();
        let profile = device.profile();
        let traffic = profile.traffic;
        // A copy each way, through one buffer, where the host does not reach the memory.
        let copies = traffic.submissions - 1;
        assert_eq!(traffic.buffers, 1 + copies / 2, "{traffic:?}");
        assert!(copies == 2 || copies == 0 && !staging, "{traffic:?}");
        if device.description().kind == DeviceKind::Cpu {
            assert_eq!(copies, if staging { 2 } else { 0 });
        }
        assert_eq!([traffic.submissions, traffic.waits], [1 + copies; 2], "{traffic:?}");
        assert_eq!([traffic.bytes_to_device, traffic.bytes_to_host], [8, 20]);
        let fill = profile.kernels["fill"];
        assert_eq!([fill.dispatches, fill.groups, fill.largest], [2, 11, 10]);
        assert_eq!(fill.mean().to_bits(), 5.5_f64.to_bits());
        // A device without timestamps knows no time.
        assert!(fill.seconds.is_none_or(|seconds| (0.0..60.0).contains(&seconds)), "{fill:?}");
        assert!(fill.seconds.is_some() || device.description().kind != DeviceKind::Cpu);
        assert_eq!(device.validation_messages(), 0);
    }
}

#[test]
fn a_buffer_beyond_the_storage_buffer_range_is_reached_by_address() {
    let device = open(false);
    let count = 10u32 << 20;
    let bytes = u64::from(count) * 16;
    let entries = device.buffer("160 MiB", bytes, Memory::Device).unwrap();
    let kernel = device.kernel_from("fill", shaders::FILL, 16).unwrap();
    let push = FillPush { entries: entries.address(), count, scale: 1.0 };
    // More groups than a row of a dispatch may have: the kernel counts them over x and y.
    let groups = [device.max_groups()[0].min(65_535), 3, 1];
    device.run(|r| r.dispatch(&kernel, bytes_of(&push), groups)).unwrap();
    let last: Vec<Entry> = entries.read(bytes - 16, 1).unwrap();
    assert_eq!(last[0].index, count - 1);
    assert_eq!(device.validation_messages(), 0);
}

#[test]
fn a_dispatch_too_large_for_the_device_is_an_error() {
    let device = open(false);
    if device.max_groups()[0] == u32::MAX {
        eprintln!("this device takes any dispatch");
        return;
    }
    let kernel = device.kernel_from("fill", shaders::FILL, 16).unwrap();
    let push = FillPush { entries: 0, count: 0, scale: 1.0 };
    let groups = [device.max_groups()[0] + 1, 1, 1];
    let error = device.run(|r| r.dispatch(&kernel, bytes_of(&push), groups)).unwrap_err();
    assert!(error.to_string().contains("at most"), "{error}");
    assert_eq!(device.validation_messages(), 0);
}

#[test]
fn what_a_submission_uses_may_be_dropped_while_it_runs() {
    let device = open(false);
    let result = device.buffer("result", 16 << 16, Memory::Host).unwrap();
    let submissions: Vec<_> = (0..4)
        .map(|_| {
            let kernel = device.kernel_from("fill", shaders::FILL, 16).unwrap();
            let entries = device.buffer("entries", 16 << 16, Memory::Device).unwrap();
            let push = FillPush { entries: entries.address(), count: 1 << 16, scale: 1.0 };
            device
                .submit(|r| {
                    r.dispatch(&kernel, bytes_of(&push), [1 << 10, 1, 1]);
                    r.barrier();
                    r.copy(&entries, 0, &result, 0, 16 << 16);
                })
                .unwrap()
        })
        .collect();
    // The first is dropped without a wait, the rest are waited for last to first.
    let mut submissions = submissions.into_iter();
    drop(submissions.next());
    for submission in submissions.rev() {
        submission.wait().unwrap();
    }
    let last: Vec<Entry> = result.read((16 << 16) - 16, 1).unwrap();
    assert_eq!(last[0].index, (1 << 16) - 1);
    assert_eq!(device.validation_messages(), 0);
}

#[test]
fn more_memory_than_one_allocation_may_have_is_a_memory_error() {
    let device = open(false);
    let bytes = device.description().max_allocation_bytes.saturating_add(1);
    let error = device.buffer("far too much", bytes, Memory::Device).unwrap_err();
    assert!(matches!(error, Error::Memory { .. }), "{error}");
    assert_eq!(device.validation_messages(), 0);
}

#[test]
fn devices_are_listed_and_chosen_by_index_and_name() {
    let devices = Device::list().unwrap();
    let usable = devices.iter().find(|d| d.problem.is_none()).unwrap();
    assert!(usable.subgroup_size > 0 && usable.memory_bytes > 0 && !usable.driver.is_empty());
    for choice in [usable.index.to_string(), usable.name.to_uppercase()] {
        let options = DeviceOptions { choice: Some(choice), ..Default::default() };
        assert_eq!(Device::open(&options).unwrap().description().name, usable.name);
    }
}

#[test]
fn a_device_that_is_not_there_is_an_error_that_lists_those_that_are() {
    let choice = Some("no such device".to_owned());
    let error = Device::open(&DeviceOptions { choice, ..Default::default() }).unwrap_err();
    let text = error.to_string();
    assert!(matches!(error, Error::Device { .. }), "{text}");
    assert!(text.contains("no such device"), "{text}");
    assert!(text.contains(&Device::list().unwrap()[0].name), "{text}");
}

/// Output of a process of its own that opens a device in that environment.
fn opened_with(environment: &[(&str, &str)]) -> String {
    let output = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "gpu::open_and_say", "--ignored", "--nocapture"])
        .envs(environment.iter().copied())
        .output()
        .unwrap();
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn without_a_driver_the_error_names_the_package() {
    let nothing = "/nonexistent.json";
    let text = opened_with(&[("VK_DRIVER_FILES", nothing), ("VK_ICD_FILENAMES", nothing)]);
    assert!(text.contains("mesa-vulkan-drivers"), "{text}");
}

#[test]
fn the_environment_chooses_a_device() {
    let text = opened_with(&[("BEAMLET_DEVICE", "no such device")]);
    assert!(text.contains("device \"no such device\": it is not among"), "{text}");
}

#[test]
fn messages_of_the_validation_layer_are_counted() {
    let device = open(false);
    if device.validation() {
        // The push constants of the shader are longer than those of the kernel.
        let _ = device.kernel_from("short push", shaders::FILL, 8);
        assert!(device.validation_messages() > 0);
    }
}

#[test]
#[ignore = "run by opened_with"]
fn open_and_say() {
    match Device::open(&DeviceOptions::default()) {
        Ok(device) => println!("{device:?}"),
        Err(error) => println!("{error}"),
    }
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct CrossingsPush {
    scene: u64,
    counts: u64,
    rays: u32,
    spacing: f32,
}

/// Two unit squares across +y, of two triangles each, the second half as wide.
/// A square 1 wide at y = 0 and one 0.5 wide at y = 1, as flat boxes.
const SQUARES: [[[f32; 3]; 2]; 2] =
    [[[0.0, 0.0, 0.0], [1.0, 0.0, 1.0]], [[0.0, 1.0, 0.0], [0.5, 1.0, 0.5]]];

#[test]
fn a_ray_query_sees_every_box_of_a_structure_given_by_address_once() {
    let device = open(false);
    if !device.description().ray_query {
        let refused = device.kernel_from("crossings", shaders::CROSSINGS, 24).unwrap_err();
        assert!(refused.to_string().contains("no ray query"), "{refused}");
        assert!(!complete(), "no ray query, and BEAMLET_COMPLETE is set");
        eprintln!("no ray query on this device");
        return;
    }
    let boxes = device.upload("boxes", &SQUARES).unwrap();
    let structure = AccelerationStructure::build(&device, &boxes, 2).unwrap();
    drop(boxes);
    let rays = 20u32;
    let kernel = device.kernel_from("crossings", shaders::CROSSINGS, 24).unwrap();
    let counts = device.buffer("counts", u64::from(rays) * 4, Memory::Host).unwrap();
    let push = CrossingsPush {
        scene: structure.address(),
        counts: counts.address(),
        rays,
        spacing: 0.0625,
    };
    device.run(|r| r.dispatch(&kernel, bytes_of(&push), [rays.div_ceil(64), 1, 1])).unwrap();
    let counts: Vec<u32> = counts.read(0, rays as usize).unwrap();
    // Low bits: crossings; the rest: the sum of their primitives. Rays run at z = 0.25.
    for (i, &count) in (0u16..).zip(&counts) {
        let x = (f32::from(i) + 0.5) * 0.0625;
        let crossing = |width: f32, first: u32| u32::from(x < width) * (1 + 16 * first);
        assert_eq!(count, crossing(1.0, 0) + crossing(0.5, 1), "at x = {x}");
    }
    assert_eq!(device.validation_messages(), 0);
}
