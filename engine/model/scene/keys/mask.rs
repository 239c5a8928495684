//! Keys of the masks.

use super::prelude::*;
use super::rectangles::turn;
use super::series::{RANGE, read_file};
use crate::scene::{
    ApertureLattice, ApertureShape, BarLayer, Detector, MaskBody, MaskSpec, Pattern, Substrate,
};
use std::path::Path;

keys! { MASK: MaskSpec, "sample_mask",
    [Forms(&[&["transmission"], &["material", "thickness"], &["layers"]], 1),
     Forms(&[&["aperture"], &["projected_aperture"], &["apertures"], &["pattern", "pattern_pixel"], &["rectangles"]], 0)],
    ["pitch" => "period", "slit" => "aperture", "slit_width" => "aperture", "opening" => "aperture",
     "height" => "thickness"];
    distance => Quantity(Length, POSITIVE),
        Without("sample mask: required; detector mask: back face on the detector"), r#""1.2 m""#,
        "Distance from the source to the centre plane of the bars.";
    material at MaskSpec { body: MaskBody::Bars { material, .. }, .. } =>
        MATERIAL, Required, r#""gold""#, "Material of the bars.";
    thickness at MaskSpec { body: MaskBody::Bars { thickness, .. }, .. } =>
        Quantity(Length, POSITIVE), Required, r#""225 um""#, "Thickness of the bars along the beam.";
    layers at MaskSpec { body: MaskBody::Layers { layers }, .. } =>
        Tables(&BAR_LAYER.spec), Required,
        r#"[{ material = "gold", thickness = "30 um" }, { material = "silicon", thickness = "200 um" }]"#,
        "Layers of bars of several materials, from the source on: they have the same slits.";
    taper => Quantity(Angle, within(-limits::TAPER, limits::TAPER)), Default(r#""0 deg""#), r#""2 deg""#,
        "Angle between the walls of the bars and the optical axis: above 0 slits are wider at the face towards the detector, below 0 at the face towards the source. `aperture` is their width in the centre plane; of slits with bars of a thickness.";
    transmission at MaskSpec { body: MaskBody::Sheet { transmission }, .. } =>
        Number("a number", within(0.0, 1.0)), Required, "0.0",
        "Transmission of the bars of a sheet without thickness.";
    aperture => Quantity(Length, POSITIVE), Required, r#""20 um""#,
        "Width of the slits in the plane of the mask, up to the period.";
    projected_aperture by hand => Quantity(Length, POSITIVE), Required, r#""30 um""#,
        "Width of the slits in the plane of the detector.";
    apertures => Either("", &Ends(limits::SLITS), &File("path of a CSV file")), Required,
        r#"[["-30 um", "-10 um"], ["5 um", "25 um"]]"#,
        "Ends of the slits of a period from its middle, in the plane of the mask, ascending; a list or a file with the columns `end_0_um` and `end_1_um`.";
    pattern => Either("", &Bits(limits::PATTERN), &File("path of a PNG, TIFF, NPY or CSV file")), Required,
        r#""coded.png""#,
        "Open pixels of a period along x and z: the larger value of an image of two values, or 1 in a CSV file or in texts of 0 and 1. Row 0 is on top; columns ascend along x.";
    pattern_pixel => Pair(POSITIVE), Required, r#""5 um""#,
        "Size of a pixel of the pattern in the plane of the mask; times columns and rows it is the period along x and z.";
    rectangles => Either("", &Rectangles(limits::SLITS), &File("path of a CSV file")), Required,
        r#"[["-20 um", "10 um", "15 um", "30 um"], ["15 um", "-5 um", "20 um", "20 um"]]"#,
        "Rectangular apertures of a period in the plane of the mask, each the x and z of its middle from the middle of the period, its width and its height; a list or a file with the columns `x_um`, `z_um`, `width_um` and `height_um`.";
    shifts => Either("", &Series(Length, limits::SLITS), &Inner(&RANGE)), Without("none"),
        r#"["0 um", "12 um"]"#,
        "Displacements along +x of the slits of successive periods, in the plane of the mask: period k has entry k modulo their number.";
    period => Quantity(Length, POSITIVE), Without("pitch × mask distance / detector distance"), r#""100 um""#,
        "Distance from slit to slit in the plane of the mask, or from the slits of a period to the next ones; up to 1000 apertures in a pixel, and 16777216 in all whose light reaches the detector.";
    offset => Quantity(Length, ANY), Default(r#""0 m""#), r#""2 um""#,
        "Displacement of the slits along +x in the plane of the mask.";
    substrate => Inner(&SUBSTRATE.spec), Without("none"),
        r#"{ material = "silicon", thickness = "500 um" }"#,
        "Flat plate that carries the bars: it attenuates all light of the mask.";
    shape => Word(SHAPES), Without("slits along z, or rectangles where `aperture_z` or `period_z` is given"),
        r#""round""#,
        "Outline of the apertures: slits along z, rectangles, ellipses, or crosses with arms a third as wide.";
    aperture_z => Quantity(Length, POSITIVE), Without("the width of the apertures"), r#""20 um""#,
        "Height of the apertures in the plane of the mask, up to the period along z; not of slits.";
    lattice => Word(LATTICES), Default("\"rectangular\""), r#""hexagonal""#,
        "Places of the apertures: rows above each other, or every second row displaced by half a period; not of slits.";
    period_z => Quantity(Length, POSITIVE), Without("the period along x, √3/2 of it with `lattice = \"hexagonal\"`"), r#""100 um""#,
        "Distance along z from a row of apertures to the next in the plane of the mask; not of slits.";
    offset_z => Quantity(Length, ANY), Default(r#""0 m""#), r#""2 um""#,
        "Displacement of the apertures along +z in the plane of the mask; not of slits.";
    rotation by hand => Quantity(Angle, ANY), Default(r#""0 deg""#), r#""90 deg""#,
        "Rotation of each period about its middle, right-handed about +y (clockwise as the source sees it), before the mask is displaced: multiples of 90°, of 45° for circles on a square lattice, of 30° for circles on a lattice of equilateral triangles; not of slits.";
}

keys! { SUBSTRATE: Substrate, "sample_mask.substrate", [], [];
    material => MATERIAL, Required, r#""silicon""#, "Material of the plate.";
    thickness => Quantity(Length, POSITIVE), Required, r#""500 um""#,
        "Thickness of the plate along the beam.";
}

keys! { BAR_LAYER: BarLayer, "sample_mask.layers", [], [];
    material => MATERIAL, Required, r#""gold""#, "Material of the layer.";
    thickness => Quantity(Length, POSITIVE), Required, r#""30 um""#,
        "Thickness of the layer along the beam.";
}

impl Record for BarLayer {
    const KEYS: &'static Keys<Self> = &BAR_LAYER;

    fn begin(_: &dyn Fn(&str) -> bool) -> Self {
        Self::new("", f64::NAN)
    }
}

impl Record for Substrate {
    const KEYS: &'static Keys<Self> = &SUBSTRATE;

    fn begin(_: &dyn Fn(&str) -> bool) -> Self {
        Self::new("", f64::NAN)
    }
}

words!(ApertureLattice, LATTICES: "rectangular" => Rectangular, "hexagonal" => Hexagonal);
words!(ApertureShape, SHAPES: "slit" => Slit, "rectangle" => Rectangle, "round" => Round, "cross" => Cross);

impl Record for MaskSpec {
    const KEYS: &'static Keys<Self> = &MASK;

    fn begin(has: &dyn Fn(&str) -> bool) -> Self {
        let body = match (has("transmission"), has("material") || has("thickness"), has("layers")) {
            (true, ..) => MaskBody::Sheet { transmission: f64::NAN },
            (_, false, true) => MaskBody::Layers { layers: Vec::new() },
            _ => MaskBody::Bars { material: String::new(), thickness: f64::NAN },
        };
        let mut mask = Self::new(f64::NAN, f64::NAN, f64::NAN, body);
        if has("aperture_z") || has("period_z") || has("rectangles") {
            mask.shape = ApertureShape::Rectangle;
        }
        mask
    }

    fn finish(&mut self, _: &Table<'_>) -> Result<()> {
        if let (Some(pattern), Some(pixel)) = (self.pattern.take(), self.pattern_pixel) {
            *self = self.clone().with_pattern(pattern, pixel);
        }
        if !self.apertures.is_empty() {
            self.aperture = narrowest(&self.apertures);
        }
        Ok(())
    }

    fn leaves_out(&self, key: &str) -> bool {
        match key {
            "aperture" => !self.apertures.is_empty() || self.list_key().is_some(),
            "period" | "period_z" if self.pattern.is_some() => true,
            "shape" | "aperture_z" if self.list_key().is_some() => true,
            "rectangles" => self.rectangles.is_empty(),
            "apertures" => self.apertures.is_empty(),
            "shifts" => self.shifts.is_empty(),
            "substrate" => self.substrate.is_none(),
            "taper" => self.taper == 0.0,
            "shape" => self.shape == ApertureShape::Slit,
            "lattice" => self.lattice == ApertureLattice::Rectangular,
            "offset_z" => self.shape == ApertureShape::Slit && self.offset_z == 0.0,
            _ => false,
        }
    }

    fn relations(&self, key: &dyn Fn(&str) -> String, faults: &mut Faults) {
        if let Some(list) = self.list_key() {
            self.check_list(list, key, faults);
        }
        if self.period > 0.0 && self.aperture <= self.period {
            faults.note(self.check_slits(key));
        }
        faults.note(self.check_layers(key));
        if self.taper != 0.0 {
            faults.note(self.check_taper(key));
        }
        match self.shape {
            ApertureShape::Slit => self.refuse_heights(key, faults),
            _ => self.check_heights(key, faults),
        }
    }
}

impl MaskSpec {
    /// Layers belong to slits along z, and are few.
    fn check_layers(&self, key: &dyn Fn(&str) -> String) -> Result<()> {
        let MaskBody::Layers { layers } = &self.body else { return Ok(()) };
        let refuse =
            |found: String, allowed: String| Err(Error::scene(key("layers"), found, allowed));
        if !(1..=limits::LAYERS).contains(&layers.len()) {
            let allowed = format!("1 to {}", limits::LAYERS);
            return refuse(format!("{} layers", layers.len()), allowed);
        }
        if self.shape != ApertureShape::Slit {
            let found = format!("{} layers with apertures that end along z", layers.len());
            return refuse(found, "slits along z, or a material and a thickness".to_owned());
        }
        Ok(())
    }

    /// Slanted walls belong to slits along z with thick bars, and leave slits and bars open at both faces.
    fn check_taper(&self, key: &dyn Fn(&str) -> String) -> Result<()> {
        let refuse = |with: &str, allowed: &str| {
            let found = format!("{} with {with}", Angle.rounded(self.taper));
            Err(Error::scene(key("taper"), found, allowed))
        };
        if self.taper.abs() > limits::TAPER {
            return Ok(());
        }
        if self.body.thickness() == 0.0 {
            return refuse("a sheet", "no value, or bars with a material and a thickness");
        }
        if self.shape != ApertureShape::Slit {
            return refuse("apertures that end along z", "no value, or slits along z");
        }
        let narrowest = self.aperture.min(self.narrowest_bar());
        let narrower = self.body.thickness() * self.wall_slope().abs();
        if narrower >= narrowest {
            let found = format!(
                "{}, which narrows slits or bars by {} at a face",
                Angle.rounded(self.taper),
                Length.rounded(narrower)
            );
            let allowed =
                format!("less than the narrowest slit or bar, {}", Length.rounded(narrowest));
            return Err(Error::scene(key("taper"), found, allowed));
        }
        Ok(())
    }

    /// Slits have no edges along z.
    fn refuse_heights(&self, key: &dyn Fn(&str) -> String, faults: &mut Faults) {
        let of = [
            ("aperture_z", self.aperture_z),
            ("period_z", self.period_z),
            ("offset_z", Some(self.offset_z).filter(|offset| *offset != 0.0)),
        ];
        if self.lattice != ApertureLattice::Rectangular {
            let allowed = "no value, or a `shape` other than \"slit\"";
            faults.add(Error::scene(key("lattice"), "a lattice of slits", allowed));
        }
        for (name, length) in of {
            let Some(length) = length else { continue };
            let found = format!("{} with slits, which have no end along z", Length.rounded(length));
            faults.add(Error::scene(
                key(name),
                found,
                "no value, or a `shape` other than \"slit\"",
            ));
        }
    }

    /// A list of apertures has openings and bars, and no shadows of thick bars.
    fn check_list(&self, list: &str, key: &dyn Fn(&str) -> String, faults: &mut Faults) {
        let open = self.open_share();
        match self.check_rectangles(key) {
            Err(error) => faults.add(error),
            Ok(()) if !(open > 0.0 && open < 1.0 - 1e-9) => {
                let what = if open > 0.0 { "bars" } else { "openings" };
                let found = format!("a mask without {what}");
                faults.add(Error::scene(key(list), found, "openings and bars"));
            }
            Ok(()) => {}
        }
        if self.body.thickness() > 0.0 {
            let found = format!("{} with {list}", Length.rounded(self.body.thickness()));
            faults.add(Error::scene(
                key("thickness"),
                found,
                "a sheet (transmission) for lists of apertures",
            ));
        }
        if self.lattice != ApertureLattice::Rectangular {
            faults.add(Error::scene(key("lattice"), format!("hexagonal with {list}"), "no value"));
        }
    }

    /// Apertures with ends along z lie apart along z, and bars cast narrow shadows.
    fn check_heights(&self, key: &dyn Fn(&str) -> String, faults: &mut Faults) {
        let Some([height, period]) = self.heights() else {
            let allowed = "a height and a period along z, or the shape \"slit\"";
            faults.add(Error::scene(
                key("shape"),
                "apertures without a height or a period along z",
                allowed,
            ));
            return;
        };
        let of_slits = [("apertures", self.apertures.len()), ("shifts", self.shifts.len())];
        for (name, count) in of_slits.into_iter().filter(|(_, count)| *count > 0) {
            let found = format!("{count} {name} of slits, with apertures that end along z");
            faults.add(Error::scene(key(name), found, "one of both"));
        }
        if height > period {
            let allowed = format!("no more than the period along z, {}", Length.rounded(period));
            faults.add(Error::scene(key("aperture_z"), Length.rounded(height), allowed));
        }
    }
}

/// Rows of 0 and 1, or a file.
impl Value for Pattern {
    fn read(item: &ListItem<'_>, row: &'static Row) -> Result<Self> {
        // Open and closed pixels: no second fault of the same file.
        let none = || Self::new(ndarray::Array2::from_shape_fn((2, 2), |(i, j)| i == j));
        let most = limits::PATTERN as usize;
        let pattern = if let Some(path) = item.as_text() {
            read_file(item, Path::new(path), Self::read, none())?
        } else {
            let allowed = row.allowed();
            let items = item.items(&allowed)?;
            let texts: Vec<&str> =
                items.iter().map(|it| it.as_text().unwrap_or_default()).collect();
            match Self::of_texts(&texts) {
                Ok(pattern) if !texts.is_empty() => pattern,
                Ok(_) => return item.refuse(item.mismatch(allowed), none()),
                Err(wrong) => return item.refuse(items[wrong].mismatch(allowed), none()),
            }
        };
        let [rows, columns] = pattern.size();
        if rows > most || columns > most {
            let found = format!("{columns} x {rows} pixels");
            return item
                .refuse(item.error(found, format!("up to {most} rows and columns")), none());
        }
        Ok(pattern)
    }

    fn write(&self, _: &Row, _: &Base<'_>) -> Result<Option<String>> {
        let rows: Vec<_> = self.texts().iter().map(|row| quoted(row)).collect();
        Ok(Some(format!("[{}]", rows.join(", "))))
    }
}

/// Width of the narrowest of some slits, m.
fn narrowest(slits: &[[f64; 2]]) -> f64 {
    slits.iter().map(|[low, high]| high - low).fold(f64::INFINITY, f64::min)
}

/// Reads a mask, with what follows from the detector.
pub(crate) fn read_mask(table: &Table<'_>, key: &str, detector: &Detector) -> Result<MaskSpec> {
    let mut mask: MaskSpec = super::record::read(table)?;
    if table.get("distance").is_none() {
        mask.distance = match key {
            "detector_mask" => detector.distance - mask.body.thickness() / 2.0,
            _ => {
                table.require("distance")?;
                f64::NAN
            }
        };
    }
    if let Some(list) = mask.list_key() {
        let (follow, source): (&[_], _) = match list {
            "pattern" => (&["period", "period_z", "aperture_z", "shape"], "pattern_pixel"),
            _ => (&["aperture_z", "shape"], list),
        };
        for item in follow.iter().filter_map(|name| table.get(name)) {
            let allowed = format!("no value: it follows from {source}");
            item.refuse(item.error(format!("given beside {list}"), allowed), ())?;
        }
    }
    if mask.pattern.is_none() {
        complete(&mut mask, table, detector)?;
    }
    turn(mask, table)
}

/// Completes lengths that follow from the detector and from other lengths.
fn complete(mask: &mut MaskSpec, table: &Table<'_>, detector: &Detector) -> Result<()> {
    let distance = mask.distance;
    // Lengths on the detector shrink towards the source.
    let projected = |length: f64| length * distance / detector.distance;
    if table.get("period").is_none() {
        mask.period = projected(detector.pitch[0]);
    }
    if let Some(mut aperture) = optional(table, "projected_aperture")? {
        let length = std::slice::from_mut(&mut aperture);
        refuse_beyond(table, "projected_aperture", length)?;
        mask.aperture = projected(aperture);
    }
    // A mask without bars is allowed; the projection rounds.
    if mask.aperture > mask.period && mask.aperture <= mask.period * (1.0 + 1e-12) {
        mask.aperture = mask.period;
    }
    if mask.shape != ApertureShape::Slit {
        mask.aperture_z = mask.aperture_z.or(Some(mask.aperture));
        let rows = match mask.lattice {
            ApertureLattice::Rectangular => mask.period,
            ApertureLattice::Hexagonal => 0.75_f64.sqrt() * mask.period,
        };
        mask.period_z = mask.period_z.or(Some(rows));
    }
    if !mask.rectangles.is_empty() {
        mask.take_widths();
    }
    Ok(())
}
