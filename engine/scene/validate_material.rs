//! What an entry of `materials` has to fulfil.

use super::validate::{named, not_negative, plain, positive};
use super::{MaterialSpec, check_formula, limits, path};
use crate::units::Dimension::{Attenuation, Density};
use crate::{Error, Result, printed};

/// How far the weights of a mixture may be from 1, or in per cent from 100: tables round theirs.
const WEIGHTS_OFF: f64 = 0.005;

pub(super) fn validate_material(name: &str, spec: &MaterialSpec) -> Result<()> {
    let table = path::join("materials", name);
    named("materials", name)?;
    let key = |key: &str| path::join(&table, key);
    match spec {
        MaterialSpec::Formula { formula, density } => {
            named(&key("formula"), formula)?;
            check_formula(formula)
                .map_err(|allowed| Error::scene(key("formula"), format!("{formula:?}"), allowed))?;
            positive(&key("density"), *density, Density)?;
            light_enough(&key("density"), *density)
        }
        MaterialSpec::Mixture { parts, density } => {
            validate_mixture(&key("mixture"), parts)?;
            positive(&key("density"), *density, Density)?;
            light_enough(&key("density"), *density)
        }
        MaterialSpec::Constants { mu, delta } => {
            not_negative(&key("mu"), *mu, Attenuation)?;
            // Beyond this the expansion in delta is no longer that of X-rays.
            plain(&key("delta"), *delta, delta.abs() < 0.1, "a number between -0.1 and 0.1")
        }
        MaterialSpec::Table { path } if path.as_os_str().is_empty() => {
            Err(Error::scene(key("table"), "\"\"", "path of a file"))
        }
        MaterialSpec::Table { .. } => Ok(()),
    }
}

fn light_enough(key: &str, density: f64) -> Result<()> {
    if density <= limits::DENSITY {
        return Ok(());
    }
    let allowed = format!("up to {}", Density.format(limits::DENSITY));
    Err(Error::scene(key, Density.format(density), allowed))
}

fn validate_mixture(table: &str, parts: &[(String, f64)]) -> Result<()> {
    for (name, weight) in parts {
        let key = path::join(table, name);
        named(&key, name)?;
        check_formula(name).map_err(|allowed| Error::scene(&*key, format!("{name:?}"), allowed))?;
        plain(&key, *weight, *weight > 0.0, "a share by weight > 0")?;
    }
    let sum = parts.iter().fold(0.0, |sum, part| sum + part.1);
    let near = |whole: f64| (sum / whole - 1.0).abs() <= WEIGHTS_OFF;
    if near(1.0) || near(100.0) {
        return Ok(());
    }
    let found = format!("shares that sum to {}", printed::number(sum));
    Err(Error::scene(table, found, "shares by weight that sum to 1, or to 100 (per cent)"))
}
