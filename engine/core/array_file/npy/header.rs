//! Headers of NPY files, held to a size and shape before they are parsed.

use npyz::NpyHeader;
use std::io::{Error, ErrorKind, Read, Result, Seek, SeekFrom};

/// Magic, version, and the length of the header in version 1 or, with two bytes more, 2 and 3.
const BEFORE: usize = 10;
/// Most bytes of a header: the limit of version 1.
const MOST: u32 = 65_535;
/// Deepest brackets: one pair for the dict, one for the shape, and one of structured types.
/// The time of the parser doubles with every one.
const DEPTH: usize = 4;

/// Reads a header; `file` is left at the first value.
///
/// # Errors
/// Why the file is not NPY, in words, or why it cannot be read.
pub(super) fn read<R: Read + Seek>(file: &mut R) -> Result<NpyHeader> {
    let refused = |problem: String| Error::new(ErrorKind::InvalidData, problem);
    let mut bytes = vec![0; BEFORE];
    file.read_exact(&mut bytes)?;
    if !bytes.starts_with(b"\x93NUMPY") {
        return Err(refused("it does not begin with the magic bytes of NPY".into()));
    }
    let length = if bytes[6] == 1 {
        u32::from(u16::from_le_bytes([bytes[8], bytes[9]]))
    } else {
        let mut high = [0; 2];
        file.read_exact(&mut high)?;
        u32::from_le_bytes([bytes[8], bytes[9], high[0], high[1]])
    };
    if length > MOST {
        return Err(refused(format!("it has {length} bytes; allowed: up to {MOST}")));
    }
    let mut dict = Vec::new();
    file.take(length.into()).read_to_end(&mut dict)?;
    // No type and no shape has them, and without them it is clear where strings end.
    let has = |part: &[u8]| dict.windows(part.len()).any(|window| window == part);
    if has(br"\") || has(b"'''") || has(br#"""""#) {
        return Err(refused("it has escapes or three quotes; allowed: plain strings".into()));
    }
    let plain = outside_strings(&dict);
    let deepest = deepest(&plain);
    if deepest > DEPTH {
        return Err(refused(format!("{deepest} brackets within one another; allowed: {DEPTH}")));
    }
    // The parser adds numbers with signs between them.
    if plain.iter().any(|byte| matches!(byte, b'+' | b'-')) {
        return Err(refused("it has numbers with signs; allowed: whole numbers".into()));
    }
    // The parser multiplies them unchecked.
    if product(&plain).is_none() {
        return Err(refused("it claims more values than 64 bits can count".into()));
    }
    file.seek(SeekFrom::Start(0))?;
    NpyHeader::from_reader(file)
}

/// The bytes that are not in strings, with a blank for each of these.
fn outside_strings(dict: &[u8]) -> Vec<u8> {
    let mut quote = None;
    let outside = |byte: &u8| match quote {
        Some(own) => {
            quote = quote.filter(|_| *byte != own);
            b' '
        }
        None if matches!(byte, b'\'' | b'"') => {
            quote = Some(*byte);
            b' '
        }
        None => *byte,
    };
    dict.iter().map(outside).collect()
}

/// Most brackets within one another.
fn deepest(plain: &[u8]) -> usize {
    let (mut open, mut deepest) = (0_usize, 0);
    for byte in plain {
        match byte {
            b'(' | b'[' | b'{' => open += 1,
            b')' | b']' | b'}' => open = open.saturating_sub(1),
            _ => {}
        }
        deepest = deepest.max(open);
    }
    deepest
}

/// The product of all numbers of the shape; 0 counts as 1.
fn product(plain: &[u8]) -> Option<u64> {
    let text = String::from_utf8_lossy(plain);
    let mut numbers = text.split(|c: char| !c.is_ascii_digit()).filter(|number| !number.is_empty());
    numbers
        .try_fold(1_u64, |product, number| product.checked_mul(number.parse::<u64>().ok()?.max(1)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    fn file(version: u8, dict: &str) -> Cursor<Vec<u8>> {
        let length = u32::try_from(dict.len()).unwrap().to_le_bytes();
        let length = if version == 1 { &length[..2] } else { &length[..] };
        Cursor::new([b"\x93NUMPY".as_slice(), &[version, 0], length, dict.as_bytes()].concat())
    }

    #[test]
    fn headers_of_every_version_are_read_and_leave_the_file_at_its_values() {
        let dict = "{'descr': '<f4', 'fortran_order': False, 'shape': (3, 2), }\n";
        for version in [1, 2, 3] {
            let mut file = file(version, dict);
            assert_eq!(read(&mut file).unwrap().shape(), [3, 2]);
            assert_eq!(file.position(), file.get_ref().len() as u64);
        }
    }

    /// Found by fuzzing: 39 bytes took ten seconds, and each further bracket as long again.
    #[test]
    fn headers_that_no_parser_should_see_are_refused_at_once() {
        for brackets in ["{{{{{{", "((((((", "[[[[[[", "{[({[({[(", &"{".repeat(60_000)] {
            let message = read(&mut file(1, brackets)).map(drop).unwrap_err().to_string();
            assert!(message.contains("within one another"), "{message}");
        }
        // Found by fuzzing, too: brackets in strings closed none, and 938 bytes took half a minute.
        for (part, problem) in [
            ("{']]]]': (0,", "within one another"),
            (r"{'\]]': (0,", "escapes"),
            ("{''']]': (0,", "three quotes"),
        ] {
            let message = read(&mut file(1, &part.repeat(12))).map(drop).unwrap_err().to_string();
            assert!(message.contains(problem), "{message}");
        }
        // Found by fuzzing, too: the product of the sides overflowed.
        for shape in
            ["4553682020284002760, 8", "0, 99999999999999999999", "9, 9, 9999999999999999999"]
        {
            let dict =
                format!("{{'descr': '|u1', 'fortran_order': False, 'shape': ({shape}), }}\n");
            let message = read(&mut file(1, &dict)).map(drop).unwrap_err().to_string();
            assert!(message.contains("more values than 64 bits"), "{message}");
        }
        let sums =
            "{'descr': '|u1', 'fortran_order': False, 'shape': (0+9, 5084090000000000+1), }\n";
        let message = read(&mut file(1, sums)).map(drop).unwrap_err().to_string();
        assert!(message.contains("signs"), "{message}");
        let long = read(&mut file(2, &" ".repeat(65_536)));
        let message = long.map(drop).unwrap_err().to_string();
        assert!(message.contains("65536 bytes; allowed: up to 65535"), "{message}");
    }
}
