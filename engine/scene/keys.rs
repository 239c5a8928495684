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
            "title",
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
    ("scan.range", &["from", "to", "count", "step", "start", "stop"]),
    ("materials.NAME", &["formula", "mixture", "density", "mu", "delta", "table"]),
    ("surroundings", &["material", "path_material", "region"]),
    (
        "surroundings.region",
        &[
            "box", "cylinder", "mesh", "unit", "group", "sha256", "center", "scale", "rotate",
            "position",
        ],
    ),
    ("surroundings.region.box", &["size"]),
    ("surroundings.region.cylinder", &["radius", "height", "sides"]),
    (
        "object",
        &[
            "name",
            "mesh",
            "unit",
            "group",
            "sha256",
            "allow_defects",
            "shape",
            "material",
            "center",
            "scale",
            "rotate",
            "position",
            "instances",
            "roughness",
            "normals",
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

/// Names that other programs and papers give to keys, by table; none of them is like its key.
const OTHER_NAMES: &[(&str, &[(&str, &str)])] = &[
    ("", &[("sample", "object"), ("objects", "object"), ("mesh", "object"), ("tube", "source")]),
    (
        "source",
        &[
            ("focal_spot", "spot"),
            ("size", "spot"),
            ("fwhm", "spot"),
            ("position", "distance"),
            ("tube", "spectrum"),
            ("kvp", "spectrum"),
            ("kv", "spectrum"),
            ("voltage", "spectrum"),
        ],
    ),
    (
        "source.spectrum",
        &[("voltage", "kvp"), ("kv", "kvp"), ("target", "anode"), ("material", "anode")],
    ),
    (
        "detector",
        &[
            ("pixel", "pitch"),
            ("pixelsize", "pitch"),
            ("pixel_size", "pitch"),
            ("pixel_pitch", "pitch"),
            ("size", "pixels"),
            ("shape", "pixels"),
            ("resolution", "pixels"),
            ("psf", "blur"),
            ("noise", "photons"),
            ("counts", "photons"),
            ("bits", "bit_depth"),
            ("scintillator", "absorber"),
            ("sensor", "absorber"),
        ],
    ),
    ("sample_mask", MASK_NAMES),
    ("detector_mask", MASK_NAMES),
    ("scan", &[("steps", "mask_offsets"), ("offsets", "mask_offsets"), ("views", "angles")]),
    (
        "scan.range",
        &[("end", "to"), ("steps", "count"), ("num", "count"), ("n", "count"), ("number", "count")],
    ),
    (
        "materials.NAME",
        &[
            ("rho", "density"),
            ("weights", "mixture"),
            ("composition", "mixture"),
            ("file", "table"),
        ],
    ),
    (
        "object",
        &[
            ("file", "mesh"),
            ("stl", "mesh"),
            ("path", "mesh"),
            ("translate", "position"),
            ("rotation", "rotate"),
        ],
    ),
];

const MASK_NAMES: &[(&str, &str)] = &[
    ("pitch", "period"),
    ("slit", "aperture"),
    ("slit_width", "aperture"),
    ("opening", "aperture"),
    ("height", "thickness"),
];

/// The key that is meant by a name which other programs give to it.
pub(super) fn other_name(table: &str, name: &str) -> Option<&'static str> {
    let names = OTHER_NAMES.iter().find(|entry| entry.0 == table)?.1;
    names.iter().find(|pair| pair.0.eq_ignore_ascii_case(name)).map(|pair| pair.1)
}
