//! Keys of the scan: mask offsets, angles, motions and dithers.

use super::frames::{ERRORS, frames, series};
use super::motion::MOTION;
use super::prelude::*;
use super::series::RANGE;
use super::steps::MaskSteps;
use crate::scene::{Fly, RotationAxis, Scan};

/// A list or range of lengths, or pairs of them, or a file.
const STEPS: Kind = Either(
    "",
    &Either(
        "",
        &Either("", &Series(Length, limits::MASK_OFFSETS), &Inner(&RANGE)),
        &Ends(limits::MASK_OFFSETS),
    ),
    &File("path of a CSV file"),
);

keys! { SCAN: Scan, "scan", [],
    ["steps" => "mask_offsets", "offsets" => "mask_offsets", "views" => "angles", "pitch" => "travel"];
    mask_offsets by MaskSteps => STEPS,
        Default(r#"["0 m"]"#), r#"["-10 um", "0 um", "10 um"]"#,
        "Displacements of the sample mask in its own plane: along +x, or pairs along +x and +z for apertures that end along z.";
    view_offsets => frames!(Some(Length)),
        Without("`mask_offsets` at every angle"), r#""offsets.csv""#,
        "Displacements of the sample mask at each angle, one per mask step; the flat has `mask_offsets`.";
    angles => series!(Angle, limits::ANGLES), Default(r#"["0 deg"]"#),
        r#"{ from = "0 deg", to = "360 deg", count = 360 }"#,
        "Rotation of source, masks and detector about +z.";
    motions => Either("", &Tables(&MOTION), &File("path of a CSV file")), Without("the sample rests"),
        r#""motions.csv""#,
        "Rigid motion of the sample at each angle, before source, masks and detector turn.";
    cone_vec by hand => File("path of a file of 12 numbers a line"), Without("`angles` and `motions`"),
        r#""vectors.txt""#,
        "Vectors of ASTRA's cone_vec, mm, for each view; in place of `angles` and `motions`.";
    axis => Inner(&AXIS.spec), Without("the z axis"), r#"{ shift = ["0.1 mm", "0 mm", "0 mm"] }"#,
        "Axis of rotation in the frame of the set-up; the sample is moved with it.";
    travel => Lengths("lengths along x, y and z", ANY), Default(r#"["0 m", "0 m", "0 m"]"#),
        r#"["0 mm", "0 mm", "2 mm"]"#,
        "Displacement of the sample for each full turn of the angle: along z helical, along x cycloidal.";
    dithers => Either("", &Series(Length, limits::DITHERS), &Inner(&RANGE)),
        Without("one view for each angle"), r#"["-10 um", "10 um"]"#,
        "Displacements of the sample along +x of the set-up; each angle has a view for each of them.";
    fly => Inner(&FLY.spec), Without("the sample rests in each view"),
        r#"{ count = 8, sweep = "1 deg" }"#,
        "Turn of the sample during the exposure of a view, whose intensities are means.";
    flats_every => Count(1, limits::ANGLES as u64), Without("one flat before the first view"), "50",
        "Views between one flat and the next; the first is taken before the first view, the last behind the last.";
    darks_every => Count(1, limits::ANGLES as u64), Without("one dark behind the first flat"), "100",
        "Views between dark frames, as `flats_every`; needs `detector.photons`.";
    errors => Inner(&ERRORS), Without("none"), r#"{ offset_sigma = "2 um" }"#,
        "Errors of offsets and intensity; retrieval does not know them.";
}

impl Record for Scan {
    const KEYS: &'static Keys<Self> = &SCAN;

    fn begin(_: &dyn Fn(&str) -> bool) -> Self {
        Self::default()
    }

    /// Motions without angles belong to views at angle 0.
    fn finish(&mut self, table: &Table<'_>) -> Result<()> {
        if table.get("angles").is_none() && self.motions.len() > 1 {
            self.angles = vec![0.0; self.motions.len()];
        }
        // Vectors make views when source and detector are known.
        if table.get("cone_vec").is_none() {
            self.draw_errors();
        }
        Ok(())
    }

    fn leaves_out(&self, key: &str) -> bool {
        match key {
            "view_offsets" => self.view_offsets.is_empty(),
            "motions" => self.motions.is_empty(),
            "axis" => self.axis == RotationAxis::default(),
            "travel" => self.travel.iter().all(|length| *length == 0.0),
            "dithers" => self.dithers.is_empty(),
            "fly" => self.fly.is_none(),
            "flats_every" => self.flats_every.is_none(),
            "darks_every" => self.darks_every.is_none(),
            "errors" => self.errors.is_none(),
            _ => false,
        }
    }
}

keys! { FLY: Fly, "scan.fly", [], [];
    count => Count(1, limits::FLY as u64), Required, "8",
        "Angles of a view, in the middles of equal parts of the sweep.";
    sweep => Quantity(Angle, ANY), Required, r#""1 deg""#,
        "Turn during the exposure; the angle of the view is in its middle.";
}

impl Record for Fly {
    const KEYS: &'static Keys<Self> = &FLY;

    fn begin(_: &dyn Fn(&str) -> bool) -> Self {
        Self::new(1, f64::NAN)
    }
}

keys! { AXIS: RotationAxis, "scan.axis", [], [];
    shift => Lengths("lengths along x, y and z", ANY), Default(r#"["0 m", "0 m", "0 m"]"#),
        r#"["0.1 mm", "0 mm", "0 mm"]"#, "Displacement of the axis from the rotation centre.";
    tilt_x => Quantity(Angle, ANY), Default(r#""0 deg""#), r#""0.2 deg""#,
        "Rotation of the axis about +x, after `tilt_y`.";
    tilt_y => Quantity(Angle, ANY), Default(r#""0 deg""#), r#""0.1 deg""#,
        "Rotation of the axis about +y.";
}

impl Record for RotationAxis {
    const KEYS: &'static Keys<Self> = &AXIS;

    fn begin(_: &dyn Fn(&str) -> bool) -> Self {
        Self::default()
    }
}
