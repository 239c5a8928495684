//! Keys of the source: its spot, and its beam as one energy or a spectrum.

use super::prelude::*;
use super::spot::SPOT;
use crate::scene::beam::{ANODE_ANGLE, ANODE_ANGLES};
use crate::scene::{Anode, Beam, Filter, Source, SpectrumOrigin, SpectrumSpec};

const FILE: &str = "path of a file with the columns energy_keV and weight";
/// Largest tube current, mA.
const CURRENT: f64 = 1e6;
const FORMS: &str = "path of a file, { file = ... } or { anode = ..., kvp = ... }";

keys! { SOURCE: Source, "source", [Forms(&[&["energy"], &["spectrum"]], 0)],
    ["focal_spot" => "spot", "size" => "spot", "fwhm" => "spot", "position" => "distance",
     "tube" => "spectrum", "kvp" => "spectrum", "kv" => "spectrum", "voltage" => "spectrum",
     "tube_current" => "current", "ma" => "current"];
    distance => Quantity(Length, POSITIVE), Required, r#""1.21 m""#,
        "Distance from the source to the rotation centre.";
    spot => Either("", &Pair(NOT_NEGATIVE), &Inner(&SPOT)), Required, r#"["30 um", "26 um"]"#,
        "Full width at half maximum of a Gaussian focal spot, 0 for a point, up to the larger side of the detector or 1 mm; or a table of another spot.";
    energy at Source { beam: Beam::Energy(energy), .. } =>
        Quantity(Energy, POSITIVE), Required, r#""30 keV""#, "Energy of all photons.";
    spectrum at Source { beam: Beam::Spectrum(spectrum), .. } =>
        Either(FORMS, &File(FILE), &Inner(&SPECTRUM.spec)), Required, r#""tube.csv""#,
        "Photons of many energies: a file, or a table.";
    current => Quantity(Current, POSITIVE.up_to(CURRENT)), Without("none; with `detector.exposure`"), r#""10 mA""#,
        "Tube current of the built-in tube during an exposure.";
}

impl Record for Source {
    const KEYS: &'static Keys<Self> = &SOURCE;

    fn begin(has: &dyn Fn(&str) -> bool) -> Self {
        let beam = match has("spectrum") {
            true => Beam::Spectrum(SpectrumSpec::begin(&|_| false)),
            false => Beam::Energy(f64::NAN),
        };
        Self::new(f64::NAN, [f64::NAN; 2], beam)
    }

    fn comments(&self, key: &str) -> Vec<String> {
        let fit = self.spot.fit().filter(|_| key == "spot");
        let parts = self.spot.parts().len();
        fit.map(|fit| format!("spot: {parts} Gaussians for {}", fit.file)).into_iter().collect()
    }
}

keys! { SPECTRUM: SpectrumSpec, "source.spectrum",
    [Forms(&[&["file"], &["anode", "kvp", "anode_angle", "inherent_filters"]], 1)],
    ["voltage" => "kvp", "kv" => "kvp", "target" => "anode", "material" => "anode"];
    file at SpectrumSpec { origin: SpectrumOrigin::File { path: file }, .. } =>
        File(FILE), Required, r#""tube.csv""#, "Rows of energy in keV and weight in photons.";
    anode at SpectrumSpec { origin: SpectrumOrigin::Tube { anode, .. }, .. } =>
        Word(ANODES), Required, r#""tungsten""#, "Metal of the target.";
    kvp at SpectrumSpec { origin: SpectrumOrigin::Tube { kvp, .. }, .. } =>
        Quantity(Voltage, ANY), Required, r#""60 kV""#,
        "Tube voltage: 20 kV to 160 kV for tungsten, to 50 kV for molybdenum.";
    anode_angle at SpectrumSpec { origin: SpectrumOrigin::Tube { anode_angle, .. }, .. } =>
        Quantity(Angle, within(ANODE_ANGLES[0], ANODE_ANGLES[1])), Default(r#""12 deg""#), r#""20 deg""#,
        "Angle between the face of the target and the optical axis.";
    inherent_filters at SpectrumSpec { origin: SpectrumOrigin::Tube { inherent_filters, .. }, .. } =>
        Tables(&FILTER.spec), Default("[]"), r#"[{ material = "beryllium", thickness = "0.2 mm" }]"#,
        "Filters of the tube itself: window, oil, housing.";
    filters => Tables(&FILTER.spec), Default("[]"), r#"[{ material = "Al", thickness = "1 mm" }]"#,
        "Filters behind the tube, or behind the spectrum of a file.";
    nodes => Count(1, limits::NODES as u64), Without("for an error below 0.1 %"), "12",
        "Number of energies that represent the spectrum.";
}

words!(Anode, ANODES: "tungsten" => Tungsten, "molybdenum" => Molybdenum);

impl Record for SpectrumSpec {
    const KEYS: &'static Keys<Self> = &SPECTRUM;

    fn begin(has: &dyn Fn(&str) -> bool) -> Self {
        Self::new(match has("file") {
            true => SpectrumOrigin::File { path: PathBuf::new() },
            false => SpectrumOrigin::Tube {
                anode: Anode::Tungsten,
                kvp: f64::NAN,
                anode_angle: ANODE_ANGLE,
                inherent_filters: Vec::new(),
            },
        })
    }

    fn short(item: &ListItem<'_>) -> Option<Result<Self>> {
        let path = |text| SpectrumOrigin::File { path: PathBuf::from(text) };
        Some(item.text(FORMS).map(|text| Self::new(path(text))))
    }

    fn relations(&self, key: &dyn Fn(&str) -> String, faults: &mut Faults) {
        let SpectrumOrigin::Tube { anode, kvp, .. } = &self.origin else { return };
        let [low, high] = anode.kvp_range();
        if !(low..=high).contains(kvp) {
            let allowed = format!("{low} kV to {high} kV for an anode of {}", anode.name());
            faults.add(Error::scene(key("kvp"), Voltage.rounded(*kvp), allowed));
        }
    }
}

keys! { FILTER: Filter, "source.spectrum.filter", [], [];
    material => MATERIAL, Required, r#""aluminium""#, "Material of the sheet.";
    thickness => Quantity(Length, POSITIVE.below(1.0)), Required, r#""1 mm""#,
        "Thickness along the beam.";
}

impl Record for Filter {
    const KEYS: &'static Keys<Self> = &FILTER;

    fn begin(_: &dyn Fn(&str) -> bool) -> Self {
        Self::new("", f64::NAN)
    }
}
