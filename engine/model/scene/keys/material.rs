//! Keys of a material that the scene defines.

use super::prelude::*;
use crate::scene::formula::check_formula;
use crate::scene::{MaterialSpec, path};

/// How far the weights of a mixture may be from 1, or in per cent from 100: tables round theirs.
const WEIGHTS_OFF: f64 = 0.005;
const SHARE: Kind = Number("a share by weight", POSITIVE);
/// Refractive index decrement: beyond this range the expansion for X-rays does not hold.
const DELTA: Range = Range { low: Some((-0.1, false)), high: Some((0.1, false)) };

keys! { MATERIALS: MaterialSpec, "materials.NAME",
    [Forms(&[&["table"], &["formula", "density"], &["mixture", "density"], &["mu", "delta"]], 1)],
    ["rho" => "density", "weights" => "mixture", "composition" => "mixture", "file" => "table", "beta" => "mu"];
    formula at MaterialSpec::Formula { formula, .. } =>
        Name("a chemical formula, such as \"H2O\""), Required, r#""H2O""#,
        "Chemical formula, up to 200 characters, with 1e-6 to 1e6 atoms of an element.";
    mixture at MaterialSpec::Mixture { parts: mixture, .. } =>
        Named(&SHARE), Required, "{ Cu = 63, Zn = 37 }",
        "Shares by weight, which sum to 1 or to 100.";
    density at MaterialSpec::Formula { density, .. } | MaterialSpec::Mixture { density, .. } =>
        Quantity(Density, POSITIVE.up_to(limits::DENSITY)), Required, r#""2.0 g/cm3""#, "Mass density.";
    mu at MaterialSpec::Constants { mu, .. } =>
        Quantity(Attenuation, NOT_NEGATIVE), Required, r#""0.25 /cm""#,
        "Attenuation coefficient at the one energy of the scene.";
    delta at MaterialSpec::Constants { delta, .. } => Number("a number", DELTA), Required, "2.4e-7",
        "Decrement of the refractive index at the one energy of the scene.";
    table at MaterialSpec::Table { path: table } => File("path of a file"), Required, r#""resin.csv""#,
        "Table with the columns `energy_keV,mu_per_cm,delta`.";
}

impl Record for MaterialSpec {
    const KEYS: &'static Keys<Self> = &MATERIALS;

    fn begin(has: &dyn Fn(&str) -> bool) -> Self {
        let density = f64::NAN;
        if has("table") {
            Self::Table { path: PathBuf::new() }
        } else if has("mixture") {
            Self::Mixture { parts: Vec::new(), density }
        } else if has("mu") || has("delta") {
            Self::Constants { mu: f64::NAN, delta: f64::NAN }
        } else {
            Self::Formula { formula: String::new(), density }
        }
    }

    fn relations(&self, key: &dyn Fn(&str) -> String, faults: &mut Faults) {
        if let Self::Formula { formula, .. } = self {
            faults.note(chemical(&key("formula"), formula));
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
