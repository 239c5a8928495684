//! Keys of a material that the scene defines.

use super::prelude::*;
use crate::scene::formula::check_formula;
use crate::scene::{
    BodyShape, MaterialSpec, Microstructure, Scattering, ScatteringAxis, Scene, path,
};

/// How far the weights of a mixture may be from 1, or in per cent from 100: tables round theirs.
const WEIGHTS_OFF: f64 = 0.005;
const SHARE: Kind = Number("a share by weight", POSITIVE);
/// Refractive index decrement: beyond this range the expansion for X-rays does not hold.
const DELTA: Range = Range { low: Some((-0.1, false)), high: Some((0.1, false)) };
const EXPONENT: Range = within(-limits::SCATTERING_EXPONENT, limits::SCATTERING_EXPONENT);

/// A material as an entry of the scene file.
#[derive(Debug, Clone)]
pub(crate) struct MaterialEntry {
    pub(crate) spec: MaterialSpec,
    scattering: Option<f64>,
    scattering_along: Option<f64>,
    scattering_axis: Option<[f64; 3]>,
    scattering_exponent: Option<f64>,
    scattering_energy: Option<f64>,
    pub(crate) microstructure: Option<Microstructure>,
}

impl MaterialEntry {
    /// The entry of a material that has no structure.
    fn new(spec: MaterialSpec) -> Self {
        Self {
            spec,
            scattering: None,
            scattering_along: None,
            scattering_axis: None,
            scattering_exponent: None,
            scattering_energy: None,
            microstructure: None,
        }
    }

    /// The entry of a material of a scene.
    pub(crate) fn of(scene: &Scene, name: &str, spec: &MaterialSpec) -> Self {
        let scattering = scene.scattering.get(name);
        let by_energy = scattering.filter(|it| it.exponent != 0.0);
        Self {
            scattering: scattering.map(|it| it.variance),
            scattering_along: scattering.and_then(|it| it.axis).map(|axis| axis.variance),
            scattering_axis: scattering.and_then(|it| it.axis).map(|axis| axis.direction),
            scattering_exponent: by_energy.map(|it| it.exponent),
            scattering_energy: by_energy.and_then(|it| it.energy),
            microstructure: scene.microstructures.get(name).cloned(),
            ..Self::new(spec.clone())
        }
    }

    /// Scattering of the material.
    pub(crate) fn scattering(&self) -> Option<Scattering> {
        let scattering = Scattering::new(self.scattering?);
        let exponent = self.scattering_exponent.unwrap_or(0.0);
        let axis = self.scattering_axis.zip(self.scattering_along);
        let axis = axis.map(|(direction, variance)| ScatteringAxis { direction, variance });
        Some(Scattering { axis, exponent, energy: self.scattering_energy, ..scattering })
    }
}

keys! { MATERIALS: MaterialEntry, "materials.NAME",
    [Forms(&[&["table"], &["formula", "density"], &["mixture", "density"], &["mu", "delta"]], 1),
     With(&["scattering_along", "scattering_axis", "scattering_exponent", "scattering_energy"], "scattering",
          "the variance of the refraction angle per length")],
    ["rho" => "density", "weights" => "mixture", "composition" => "mixture", "file" => "table", "beta" => "mu"];
    formula at MaterialEntry { spec: MaterialSpec::Formula { formula, .. }, .. } =>
        Name("a chemical formula, such as \"H2O\""), Required, r#""H2O""#,
        "Chemical formula, up to 200 characters, with 1e-6 to 1e6 atoms of an element.";
    mixture at MaterialEntry { spec: MaterialSpec::Mixture { parts: mixture, .. }, .. } =>
        Named(&SHARE), Required, "{ Cu = 63, Zn = 37 }",
        "Shares by weight, which sum to 1 or to 100.";
    density at MaterialEntry {
        spec: MaterialSpec::Formula { density, .. } | MaterialSpec::Mixture { density, .. }, ..
    } =>
        Quantity(Density, POSITIVE.up_to(limits::DENSITY)), Required, r#""2.0 g/cm3""#, "Mass density.";
    mu at MaterialEntry { spec: MaterialSpec::Constants { mu, .. }, .. } =>
        Quantity(Attenuation, NOT_NEGATIVE), Required, r#""0.25 /cm""#,
        "Attenuation coefficient at the one energy of the scene.";
    delta at MaterialEntry { spec: MaterialSpec::Constants { delta, .. }, .. } =>
        Number("a number", DELTA), Required, "2.4e-7",
        "Decrement of the refractive index at the one energy of the scene.";
    table at MaterialEntry { spec: MaterialSpec::Table { path: table }, .. } =>
        File("path of a file"), Required, r#""resin.csv""#,
        "Table with the columns `energy_keV,mu_per_cm,delta`.";
    scattering => Quantity(Dimension::Scattering, NOT_NEGATIVE.up_to(limits::SCATTERING)), Without("none"),
        r#""2e-9 rad^2/m""#,
        "Variance of the refraction angle along one axis, per path length; across `scattering_axis` where it is given.";
    scattering_along => Quantity(Dimension::Scattering, NOT_NEGATIVE.up_to(limits::SCATTERING)),
        Without("none: the same in all directions"), r#""2e-10 rad^2/m""#,
        "Variance along `scattering_axis`: of fibres less than `scattering`, of plates across it more.";
    scattering_axis => Direction, Without("none: the same in all directions"), "[0, 0, 1]",
        "Axis of fibres, or normal of plates, in the frame of the object's shape or mesh; with `scattering_along`.";
    scattering_exponent => Number("a power of the energy", EXPONENT), Without("0"), "-4",
        "Power of the photon energy that `scattering` is proportional to; with `scattering_energy`.";
    scattering_energy => Quantity(Energy, POSITIVE), Without("none: the same at all energies"), r#""30 keV""#,
        "Photon energy of `scattering`; with `scattering_exponent`.";
    microstructure => Inner(&MICROSTRUCTURE.spec), Without("none"),
        r#"{ shape = "spheres", diameter = "10 um", fraction = 0.4, of = "silica" }"#,
        "Bodies at random places in the material, in place of `scattering`.";
}

impl Record for MaterialEntry {
    const KEYS: &'static Keys<Self> = &MATERIALS;

    fn begin(has: &dyn Fn(&str) -> bool) -> Self {
        let density = f64::NAN;
        let spec = if has("table") {
            MaterialSpec::Table { path: PathBuf::new() }
        } else if has("mixture") {
            MaterialSpec::Mixture { parts: Vec::new(), density }
        } else if has("mu") || has("delta") {
            MaterialSpec::Constants { mu: f64::NAN, delta: f64::NAN }
        } else {
            MaterialSpec::Formula { formula: String::new(), density }
        };
        Self::new(spec)
    }

    fn finish(&mut self, table: &Table<'_>) -> Result<()> {
        let together =
            [["scattering_exponent", "scattering_energy"], ["scattering_along", "scattering_axis"]];
        for keys in together.iter().filter(|keys| keys.iter().any(|key| table.get(key).is_some())) {
            ["scattering"].iter().chain(keys).try_for_each(|key| table.require(key).map(drop))?;
        }
        Ok(())
    }

    fn relations(&self, key: &dyn Fn(&str) -> String, faults: &mut Faults) {
        if let MaterialSpec::Formula { formula, .. } = &self.spec {
            faults.note(chemical(&key("formula"), formula));
        }
        if self.microstructure.is_some() && self.scattering.is_some() {
            let found = "bodies beside `scattering`";
            faults.add(Error::scene(key("microstructure"), found, "one of the two"));
        }
        if self.scattering_exponent.is_some() && self.scattering_energy.is_none() {
            let allowed = "the energy of `scattering`";
            faults.add(Error::scene(
                key("scattering_energy"),
                "nothing: the key is missing",
                allowed,
            ));
        }
    }
}

keys! { MICROSTRUCTURE: Microstructure, "materials.NAME.microstructure", [],
    ["size" => "diameter", "fill" => "fraction", "material" => "of", "diameter_spread" => "spread"];
    shape => Word(BODIES), Required, r#""spheres""#,
        "Spheres; voids, which are spheres of air; or long cylinders of all directions.";
    diameter => Quantity(Length, BODY), Required, r#""10 um""#, "Diameter of the bodies, the median of a spread.";
    spread => Number("a standard deviation of ln(diameter)", within(0.0, limits::DIAMETER_SPREAD)),
        Default("0.0"), "0.2", "How much diameters differ; 0 makes all equal.";
    fraction => Number("a fraction of the volume", POSITIVE), Required, "0.4",
        "Share of the volume that the bodies have, up to 0.74 (spheres, voids) or 0.5 (cylinders).";
    pair_distribution => File("path of a CSV file"), Without("hard spheres in equilibrium"), r#""packing.csv""#,
        "Table `r,g` of the pair distribution of spheres or voids, r in diameters: for packings beyond a fraction of 0.5.";
    of => MATERIAL, Without("`\"air\"` with `shape = \"voids\"`, else required"), r#""silica""#,
        "Material of the bodies.";
}

words!(BodyShape, BODIES: "spheres" => Spheres, "voids" => Voids, "cylinders" => Cylinders);

/// Diameters of bodies that X-rays of a laboratory tell from a solution and from parts.
const BODY: Range = Range { low: Some((1e-9, true)), high: Some((1e-2, true)) };

impl Record for Microstructure {
    const KEYS: &'static Keys<Self> = &MICROSTRUCTURE;

    fn begin(_: &dyn Fn(&str) -> bool) -> Self {
        Self::new(BodyShape::Spheres, "", f64::NAN, f64::NAN)
    }

    fn finish(&mut self, table: &Table<'_>) -> Result<()> {
        match (table.get("of"), self.shape) {
            (None, BodyShape::Voids) => self.of = "air".into(),
            (None, BodyShape::Spheres | BodyShape::Cylinders) => {
                table.require("of")?;
            }
            (Some(_), _) => {}
        }
        Ok(())
    }

    fn relations(&self, key: &dyn Fn(&str) -> String, faults: &mut Faults) {
        let (most, why) = match self.shape {
            BodyShape::Spheres | BodyShape::Voids => (0.74, "the closest packing of equal spheres"),
            BodyShape::Cylinders => (0.5, "cylinders of all directions"),
        };
        if self.shape == BodyShape::Cylinders && self.pair_distribution.is_some() {
            let allowed = "no table: the order of cylinders depends on their directions too";
            faults.add(Error::scene(key("pair_distribution"), "a table for cylinders", allowed));
        }
        if self.fraction > most {
            let allowed = format!("a number > 0, up to {most} for {why}; or `scattering`");
            faults.add(Error::scene(key("fraction"), format!("{:?}", self.fraction), allowed));
        }
    }
}

fn chemical(key: &str, formula: &str) -> Result<()> {
    let checked = check_formula(formula);
    checked.map_err(|allowed| Error::scene(key, format!("{formula:?}"), allowed))
}

/// Shares of a mixture.
impl Value for Vec<(String, f64)> {
    fn read(item: &ListItem<'_>, _: &'static Row) -> Result<Self> {
        let part = |(name, item): &(&str, ListItem<'_>)| Ok(((*name).to_owned(), item.number()?));
        item.named()?.iter().map(part).collect()
    }

    fn write(&self, _: &Row, _: &Base<'_>) -> Result<Option<String>> {
        let parts =
            self.iter().map(|(name, weight)| format!("{} = {}", quoted(name), number(*weight)));
        Ok(Some(format!("{{ {} }}", parts.collect::<Vec<_>>().join(", "))))
    }

    fn check(&self, table: &str, _: &Row, faults: &mut Faults) {
        let before = faults.0.len();
        for (name, weight) in self {
            let key = path::join(table, name);
            let checked = named(&key, name).and_then(|()| chemical(&key, name));
            faults.note(checked.and_then(|()| in_range(&key, &SHARE, *weight)));
        }
        let sum = self.iter().fold(0.0, |sum, part| sum + part.1);
        let near = |whole: f64| (sum / whole - 1.0).abs() <= WEIGHTS_OFF;
        if faults.0.len() == before && !near(1.0) && !near(100.0) {
            let found = format!("shares that sum to {}", printed::number(sum));
            let allowed = "shares by weight that sum to 1, or to 100 (per cent)";
            faults.add(Error::scene(table, found, allowed));
        }
    }
}
