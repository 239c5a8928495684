//! Sizes of memory.

use super::QuantityError;
use crate::numbers;

/// Reads a size of memory such as "512 MiB" or "2 GiB" into bytes. Units: B, KiB, MiB, GiB, TiB,
/// and the powers of ten kB, MB, GB, TB.
///
/// # Errors
///
/// [`QuantityError`] if there is no number above 0, no unit, an unknown unit, or an overflow.
pub fn memory_size(text: &str) -> Result<u64, QuantityError> {
    const UNITS: [(&str, u64); 9] = [
        ("B", 1),
        ("KiB", 1 << 10),
        ("MiB", 1 << 20),
        ("GiB", 1 << 30),
        ("TiB", 1 << 40),
        ("kB", 1_000),
        ("MB", 1_000_000),
        ("GB", 1_000_000_000),
        ("TB", 1_000_000_000_000),
    ];
    let trimmed = text.trim();
    let split = trimmed.find(|c: char| c.is_alphabetic()).unwrap_or(trimmed.len());
    let (number, unit) = trimmed.split_at(split);
    let number = number.trim().parse::<f64>().ok();
    let unit = UNITS.iter().find(|entry| entry.0 == unit);
    let bytes = number.zip(unit).map(|(number, (_, scale))| number * *scale as f64);
    match bytes {
        // Below 2^63 every whole f64 is a u64.
        Some(bytes) if (1.0..9.2e18).contains(&bytes) => {
            let whole = numbers::whole::<u64>(bytes);
            Ok(whole)
        }
        _ => Err(QuantityError {
            found: format!("\"{text}\""),
            allowed: "a size with its unit, such as \"2 GiB\"; units: B, KiB, MiB, GiB, TiB, kB, \
                      MB, GB, TB"
                .into(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_of_memory_need_a_number_above_zero_and_a_unit() {
        for (text, bytes) in
            [("512 MiB", 512 << 20), (" 2GiB ", 2 << 30), ("1.5 KiB", 1536), ("3 kB", 3000)]
        {
            assert_eq!(memory_size(text).unwrap(), bytes);
        }
        for text in ["", "2", "GiB", "2 gib", "-1 MiB", "0 B", "1e30 TiB", "NaN B", "1 MiB 2"] {
            let message = memory_size(text).unwrap_err().to_string();
            assert!(message.contains("2 GiB"), "{message}");
        }
    }
}
