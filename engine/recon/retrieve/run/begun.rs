//! The record of a retrieval as it begins, the metadata of its images, and counts of flags.

use crate::retrieve::flags;
use crate::retrieve::input::Input;
use crate::retrieve::model::Model;
use crate::retrieve::options::RetrieveOptions;
use crate::retrieve::planar::LatticeBeamlets;
use crate::retrieve::record::Record;
use crate::retrieve::retriever::Retriever;
use beamlet_core::numbers;
use beamlet_core::options::Choice;
use ndarray::Array2;
use std::collections::BTreeMap;

/// The record of a retrieval with its inputs and options; `shape`: angles, rows and columns of the images.
pub(super) fn begun(
    input: &Input,
    retriever: &Retriever,
    options: &RetrieveOptions,
    shape: [usize; 3],
) -> Record {
    let scene = input.scene();
    let (columns, bin) = input.selection();
    let mut meanings = BTreeMap::new();
    for (bit, name, meaning) in flags::MEANINGS {
        meanings.insert(flags::of_pixel(bit, 0), format!("flat {name}: {meaning}"));
        meanings.insert(flags::of_pixel(0, bit), format!("sample {name}: {meaning}"));
    }
    for (bit, name, meaning) in flags::OF_PIXEL {
        meanings.insert(bit, format!("{name}: {meaning}"));
    }
    let (expected, files) = (retriever.expected().into_iter(), scene.files.iter());
    let has_background = options.method().has_background();
    Record {
        version: beamlet_core::program::VERSION.to_owned(),
        commit: beamlet_core::program::commit(),
        title: scene.title.clone(),
        method: options.method().name().to_owned(),
        options: input.options().clone(),
        weights: options.weights.word().name.to_owned(),
        background: has_background.then(|| options.background().to_string()),
        curve: match retriever.layout().slits().map(|slits| &slits.curve.model) {
            Some(Model::Masks(masks)) => Some((**masks).clone()),
            Some(Model::Trapezoid { .. } | Model::Strips(_)) | None => None,
        },
        counts: input.counts(),
        gain: options.gain,
        gain_assumed: options.gain.is_some() && options.gain_assumed,
        read_noise: options.read_noise,
        sources: input.sources(),
        frames: input.frames().clone(),
        frame_order: input.frame_order(),
        dark: input.dark_source(),
        bad_pixels: input.bad_pixels_source(),
        omitted_steps: input.omitted_steps().to_vec(),
        kept_columns: columns.map(|columns| columns.to_string()),
        bin,
        group: Some(input.group()).filter(|group| *group > 1),
        points: match input.group() {
            1 => Vec::new(),
            _ => scene.offsets_of_group(&scene.scan.mask_offsets),
        },
        columns_m: retriever.columns_m(input),
        pitch: retriever.pitch(input.pitch()),
        lattice_m: retriever.layout().lattice().map(LatticeBeamlets::vectors),
        offsets_z: retriever.layout().offsets_z().to_vec(),
        expected_sigma: expected.map(|(name, sigma)| (name.to_owned(), sigma)).collect(),
        // In no directory, so that every path is written absolute.
        geometry: scene.to_toml("", &BTreeMap::new(), &[]).ok(),
        files: files.map(|(path, hash)| (path.display().to_string(), hash.clone())).collect(),
        offsets: scene.scan.mask_offsets.clone(),
        whole_periods: retriever.whole_periods(),
        flat_width: Some(retriever.flat_widths()[0]).filter(|width| width.is_finite()),
        magnification: scene.magnification(),
        lever_arm: scene.lever_arm(),
        angle_per_shift: retriever.angle_per_shift(),
        shape,
        flats_every: input.flats_every(),
        flagged: meanings.keys().map(|bit| (*bit, 0)).collect(),
        flags: meanings,
        ..Record::default()
    }
}

/// The metadata of every image.
pub(super) fn about(record: &Record) -> serde_json::Value {
    serde_json::json!({
        "beamlet": record.version,
        "method": record.method,
        "mask_offsets": record.offsets,
        "mask_offsets_unit": "m",
        "magnification": record.magnification,
        "lever_arm": record.lever_arm,
        "lever_arm_unit": "m",
        "row_0": "top (largest z); columns run along +x",
        "sign": "refraction > 0 deflects towards +x, refraction_z > 0 towards +z",
    })
}

/// Counts flagged pixels and those without a result.
pub(super) fn count(record: &mut Record, flag_image: Option<&Array2<f32>>) {
    let none = flags::of_pixel(flags::NO_ANSWER, flags::NO_ANSWER) | flags::BAD_PIXEL;
    for value in flag_image.into_iter().flatten() {
        let bits = numbers::whole::<u32>(f64::from(*value));
        if bits == 0 {
            continue;
        }
        for (bit, count) in &mut record.flagged {
            *count += u64::from(bits & bit != 0);
        }
        record.without_answer += u64::from(bits & none != 0);
    }
}
