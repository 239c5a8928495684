//! Numbers as words of a picture.

/// A length in the unit that suits it, to five digits.
pub(crate) fn length(metres: f64) -> String {
    match metres.abs() {
        size if size >= 1.0 || size == 0.0 => format!("{} m", short(metres)),
        size if size >= 1e-3 => format!("{} mm", short(metres * 1e3)),
        _ => format!("{} µm", short(metres * 1e6)),
    }
}

/// A distance along the axis in metres, to the micrometre.
pub(crate) fn distance(metres: f64) -> String {
    let text = format!("{metres:.6}");
    format!("{} m", text.trim_end_matches('0').trim_end_matches('.'))
}

/// Five significant digits with the minus sign of typography.
pub(crate) fn short(value: f64) -> String {
    beamlet::printed::number(value).replace('-', "−")
}

/// Two significant digits, for uncertainties.
pub(crate) fn rough(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let unit = 10.0_f64.powf(value.abs().log10().floor() - 1.0);
    short((value / unit).round() * unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_keep_their_digits_and_unit() {
        assert_eq!(length(1.5e-4), "150 µm");
        assert_eq!(length(0.0128), "12.8 mm");
        assert_eq!(distance(1.799_887_5), "1.799888 m");
        assert_eq!(short(-2.56e-7), "−2.56e−7");
        assert_eq!(
            (rough(0.021_764), rough(0.265_56), rough(21.674)),
            ("0.022".into(), "0.27".into(), "22".into())
        );
    }
}
