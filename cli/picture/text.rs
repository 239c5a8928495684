//! Numbers as words of a picture.

use super::drawing::text_width;
use crate::numbers;

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
    beamlet::cli_support::printed::number(value).replace('-', "−")
}

/// A value with its 1 sigma, to two digits of that: "1.234 ± 0.056", "(1.234 ± 0.056)e−9". Without
/// a sigma above zero, five digits of the value.
pub(crate) fn measured(value: f64, sigma: Option<f64>) -> String {
    let Some(sigma) = sigma.filter(|sigma| sigma.is_finite() && *sigma > 0.0) else {
        return short(value);
    };
    if !value.is_finite() {
        return short(value);
    }
    // Rounded first: 0.0996 has the two digits of 0.10.
    let digits = format!("{sigma:.1e}");
    let sigma: f64 = digits.parse().unwrap_or(sigma);
    let last = numbers::whole::<i32>(sigma.log10().floor()) - 1;
    let largest = numbers::whole::<i32>(value.abs().max(sigma).log10().floor());
    let text = if last >= -6 && largest < 6 {
        let decimals = usize::try_from(-last).unwrap_or(0);
        // Errors of more than two digits before the point round the value to their last one.
        let unit = 10.0_f64.powi(last);
        let round = |value: f64| if last > 0 { (value / unit).round() * unit } else { value };
        format!("{:.decimals$} ± {:.decimals$}", round(value), round(sigma))
    } else {
        let unit = 10.0_f64.powi(largest);
        let decimals = usize::try_from(largest - last).unwrap_or(0);
        format!("({:.decimals$} ± {:.decimals$})e{largest}", value / unit, sigma / unit)
    };
    text.replace('-', "−")
}

/// A text in lines of a width, broken between words.
pub(crate) fn wrapped(text: &str, width: f64, size: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ').filter(|word| !word.is_empty()) {
        match lines.last_mut() {
            Some(line) if text_width(&format!("{line} {word}"), size) <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// A text, shortened to a width.
pub(crate) fn cut(text: &str, width: f64, size: f64) -> String {
    if text_width(text, size) <= width {
        return text.to_owned();
    }
    let mut text = text.to_owned();
    while !text.is_empty() && text_width(&text, size) > width - size {
        text.pop();
    }
    text + "…"
}

/// Parts that are not empty, with dots between.
pub(crate) fn joined(parts: &[String]) -> String {
    let parts: Vec<&str> =
        parts.iter().map(String::as_str).filter(|part| !part.is_empty()).collect();
    parts.join(" · ")
}

/// A text with a capital first letter.
pub(crate) fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
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
        assert_eq!(wrapped("one two  three", 1e3, 12.0), ["one two three"]);
        assert_eq!(wrapped("one two three", 40.0, 12.0), ["one", "two", "three"]);
        assert_eq!(
            (rough(0.021_764), rough(0.265_56), rough(21.674)),
            ("0.022".into(), "0.27".into(), "22".into())
        );
    }

    #[test]
    fn values_have_two_digits_of_their_error() {
        for (value, sigma, text) in [
            (1.234_56, 0.0561, "1.235 ± 0.056"),
            (-12.3456, 0.561, "−12.35 ± 0.56"),
            (0.5, 0.0996, "0.50 ± 0.10"),
            (12_345.0, 678.0, "12350 ± 680"),
            (1.0, 25.0, "1 ± 25"),
            (1.234_2e-9, 5.6e-11, "(1.234 ± 0.056)e−9"),
        ] {
            assert_eq!(measured(value, Some(sigma)), text);
        }
        assert_eq!(measured(0.5, None), "0.5");
        assert_eq!(measured(0.5, Some(0.0)), "0.5");
    }
}
