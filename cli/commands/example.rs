//! `beamlet example`: scenes that come inside the program, so that the first simulation needs
//! nothing but the program.

use super::pictures::refuse_existing;
use crate::args::Example;
use crate::failure::Failure;
use std::io::Write;

/// A shipped scene.
struct Shipped {
    name: &'static str,
    about: &'static str,
    /// File name and contents.
    files: &'static [(&'static str, &'static [u8])],
}

/// The files of docs/experiments/NAME.
macro_rules! files {
    ($name:literal: $($file:literal),+) => {
        &[$((
            $file,
            include_bytes!(concat!("../../docs/experiments/", $name, "/", $file)),
        )),+]
    };
}

const SHIPPED: &[Shipped] = &[
    Shipped {
        name: "paper",
        about: "the set-up of the CAD-ASTRA paper with its first sample: the scene of `cylinder`",
        files: files!("cylinder": "scene.toml", "cylinder.stl"),
    },
    Shipped {
        name: "cylinder",
        about: "carbon cylinder of 8 mm between gold masks, one view",
        files: files!("cylinder": "scene.toml", "cylinder.stl"),
    },
    Shipped {
        name: "bracket",
        about: "nylon bracket with a carbon core inside, three views",
        files: files!("bracket": "scene.toml", "bracket.stl", "core.stl"),
    },
    Shipped {
        name: "cylinders",
        about: "water, polyethylene and carbon cylinders of 6 mm at 60 kV, one view",
        files: files!("cylinders": "scene.toml"),
    },
    Shipped {
        name: "asymmetric",
        about: "carbon cylinder of 8 mm behind an asymmetric mask, one exposure",
        files: files!("asymmetric": "scene.toml"),
    },
    Shipped {
        name: "tomography",
        about: "80,000 fibres of 5 um, thick fibres and rods in polyethylene, 360 views",
        files: files!("tomography": "scene.toml", "thick.csv"),
    },
    Shipped {
        name: "powder",
        about: "powder of silica spheres of 10 um in a cuvette of 10 mm, as a material",
        files: files!("powder": "scene.toml"),
    },
    Shipped {
        name: "two-d",
        about: "polyethylene sphere behind masks of square apertures, steps along x and z",
        files: files!("two-d": "scene.toml"),
    },
    Shipped {
        name: "beam-tracking",
        about: "polyethylene sphere behind one mask of round apertures of 15 um, pixels of 8 um",
        files: files!("beam-tracking": "scene.toml"),
    },
    Shipped {
        name: "coded",
        about: "two spheres behind a coded mask of 11 x 11 pixels, one exposure",
        files: files!("coded": "scene.toml"),
    },
    Shipped {
        name: "pepi",
        about: "plastic wires of 1 mm in a compact set-up with a spot of 5 um, by waves",
        files: files!("pepi": "scene.toml"),
    },
    Shipped {
        name: "ucl-wire",
        about: "wire of 300 um between opaque masks, spot of 70 um, by waves: a public wave simulation",
        files: files!("ucl-wire": "scene.toml"),
    },
    Shipped {
        name: "lab",
        about: "tube of PMMA and a wire behind slits for every second pixel, molybdenum at 40 kVp",
        files: files!("lab": "scene.toml"),
    },
    Shipped {
        name: "synchrotron",
        about: "two wires at a bending magnet, 20 keV, 23 m from the source, by waves",
        files: files!("synchrotron": "scene.toml"),
    },
];

pub(super) fn run(arguments: &Example, out: &mut impl Write) -> Result<(), Failure> {
    let (Some(name), Some(directory)) = (&arguments.name, &arguments.output) else {
        let width = SHIPPED.iter().map(|shipped| shipped.name.len()).max().unwrap_or(0);
        for Shipped { name, about, .. } in SHIPPED {
            writeln!(out, "{name:width$}  {about}")?;
        }
        return Ok(());
    };
    let shipped = SHIPPED.iter().find(|shipped| shipped.name == name).ok_or_else(|| {
        let names: Vec<&str> = SHIPPED.iter().map(|shipped| shipped.name).collect();
        Failure::Usage(format!("no example is named '{name}'; allowed: {}", names.join(", ")))
    })?;
    let paths: Vec<_> = shipped.files.iter().map(|(file, _)| directory.join(file)).collect();
    refuse_existing(&paths, arguments.overwrite)?;
    for (path, (_, contents)) in paths.iter().zip(shipped.files) {
        beamlet::cli_support::write_file(path, contents)?;
        writeln!(out, "{}", beamlet::cli_support::printed::path(path))?;
    }
    Ok(())
}
