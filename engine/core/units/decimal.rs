//! Decimal numbers as text, moved by powers of ten without a rounding.

/// Splits "1.5e3 um" into mantissa, power of ten, and what follows.
pub(super) fn split_number(text: &str) -> Option<(&str, i64, &str)> {
    let digits = |at: usize| text.bytes().skip(at).take_while(u8::is_ascii_digit).count();
    let sign = usize::from(text.starts_with(['+', '-']));
    let mut end = sign + digits(sign);
    let mut count = end - sign;
    if text[end..].starts_with('.') {
        let fraction = digits(end + 1);
        count += fraction;
        end += 1 + fraction;
    }
    if count == 0 {
        return None;
    }
    let mantissa = &text[..end];
    let mut exponent = 0;
    // "1eV" has no exponent: an e counts only if digits follow.
    if text[end..].starts_with(['e', 'E']) {
        let signed = usize::from(text[end + 1..].starts_with(['+', '-']));
        let count = digits(end + 1 + signed);
        if count > 0 {
            let stop = end + 1 + signed + count;
            exponent = text[end + 1..stop].parse().unwrap_or(i64::MAX);
            end = stop;
        }
    }
    Some((mantissa, exponent, text[end..].trim()))
}

/// The double nearest to a mantissa times a power of ten.
pub(super) fn shifted(mantissa: &str, exponent: i64) -> Option<f64> {
    format!("{mantissa}e{exponent}").parse().ok()
}

/// The shortest digits of `value`, divided by 10^`power` by moving the point.
pub(super) fn decimal(value: f64, power: i64) -> String {
    let text = format!("{value:e}");
    let Some((mantissa, exponent)) = text.split_once('e') else {
        return text; // not finite: never valid, shown as it is
    };
    let (sign, mantissa) = mantissa.strip_prefix('-').map_or(("", mantissa), |rest| ("-", rest));
    let digits = mantissa.replace('.', "");
    let exponent = exponent.parse::<i64>().unwrap_or(0) - power;
    let body = match usize::try_from(exponent + 1) {
        Ok(point) if point >= 1 && point >= digits.len() && point <= 16 => {
            format!("{digits:0<point$}")
        }
        Ok(point) if point >= 1 && point < digits.len() => {
            format!("{}.{}", &digits[..point], &digits[point..])
        }
        _ if (-4..0).contains(&exponent) => {
            let zeros = usize::try_from(-exponent - 1).unwrap_or(0);
            format!("0.{}{digits}", "0".repeat(zeros))
        }
        _ if digits.len() == 1 => format!("{digits}e{exponent}"),
        _ => format!("{}.{}e{exponent}", &digits[..1], &digits[1..]),
    };
    format!("{sign}{body}")
}
