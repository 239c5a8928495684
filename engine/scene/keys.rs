//! The keys of a scene file, table by table. The reader takes no other, and docs/scene.md
//! documents each (a test compares).

const MASK: &[&str] = &[
    "distance",
    "material",
    "thickness",
    "transmission",
    "aperture",
    "projected_aperture",
    "period",
    "offset",
];

const KNOWN: &[(&str, &[&str])] = &[
    (
        "",
        &[
            "source",
            "detector",
            "sample_mask",
            "detector_mask",
            "sampling",
            "scan",
            "materials",
            "surroundings",
            "object",
            "files",
        ],
    ),
    ("source", &["distance", "spot", "energy", "spectrum"]),
    ("source.spot", &["fwhm", "points", "image", "pixel", "background", "profile", "gaussians"]),
    ("source.spot.gaussian", &["weight", "fwhm", "offset"]),
    (
        "source.spectrum",
        &["file", "anode", "kvp", "anode_angle", "inherent_filters", "filters", "nodes"],
    ),
    ("source.spectrum.filter", &["material", "thickness"]),
    (
        "detector",
        &[
            "distance",
            "pixels",
            "pitch",
            "mode",
            "threshold_low",
            "threshold_high",
            "absorber",
            "blur",
            "scatter",
            "photons",
            "electronic_noise",
            "swank",
            "gain",
            "offset",
            "bit_depth",
        ],
    ),
    ("detector.absorber", &["material", "thickness"]),
    ("detector.blur", &["sigma", "fwhm", "kernel", "pixel"]),
    ("detector.scatter", &["image", "kernel", "pixel", "fraction"]),
    ("sample_mask", MASK),
    ("detector_mask", MASK),
    (
        "sampling",
        &[
            "scheme",
            "cells",
            "rows",
            "tolerance",
            "angle_tolerance",
            "max_rays",
            "rays",
            "transport",
            "seed",
        ],
    ),
    ("scan", &["mask_offsets", "angles"]),
    ("scan.range", &["from", "to", "count"]),
    ("materials.NAME", &["formula", "density", "mu", "delta", "table"]),
    ("surroundings", &["material"]),
    (
        "object",
        &[
            "name",
            "mesh",
            "unit",
            "sha256",
            "allow_defects",
            "shape",
            "material",
            "center",
            "scale",
            "rotate",
            "position",
            "instances",
        ],
    ),
    ("object.rotate", &["axis", "angle"]),
    (
        "object.shape",
        &["box", "cylinder", "cone", "prism", "extrusion", "sphere", "ellipsoid", "torus"],
    ),
    ("object.shape.box", &["size"]),
    ("object.shape.cylinder", &["radius", "height", "sides"]),
    ("object.shape.cone", &["radius", "top_radius", "height", "sides"]),
    ("object.shape.prism", &["radius", "height", "sides"]),
    ("object.shape.extrusion", &["points", "height"]),
    ("object.shape.sphere", &["radius", "sides"]),
    ("object.shape.ellipsoid", &["semi_axes", "sides"]),
    ("object.shape.torus", &["radius", "tube_radius", "sides"]),
    ("object.instances", &["packing", "region", "fill", "count", "diameter_spread", "gap", "seed"]),
    ("object.instances.region", &["box", "cylinder", "sphere"]),
    ("object.instances.region.box", &["size"]),
    ("object.instances.region.cylinder", &["radius", "height"]),
    ("object.instances.region.sphere", &["radius"]),
];

/// Every key that a scene file may have, by table; the table of the top level is "".
pub const fn known_keys() -> &'static [(&'static str, &'static [&'static str])] {
    KNOWN
}

/// The keys of one table.
pub(super) fn keys_of(table: &str) -> &'static [&'static str] {
    KNOWN.iter().find(|entry| entry.0 == table).map_or(&[], |entry| entry.1)
}
