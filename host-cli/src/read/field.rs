//! Numbers in fixed columns, from bytes, without a detour over strings.

/// The columns `start..end` of a line, as far as it goes.
pub fn columns(line: &[u8], start: usize, end: usize) -> &[u8] {
    let end = end.min(line.len());
    line.get(start..end).unwrap_or(&[])
}

/// The columns `start..end` as text: trimmed, and each byte taken for the Latin-1 character that it is.
pub fn text(line: &[u8], start: usize, end: usize) -> String {
    columns(line, start, end).trim_ascii().iter().map(|&byte| byte as char).collect()
}

/// A blank-padded whole number.
pub fn integer(field: &[u8]) -> Option<i32> {
    let digits = field.trim_ascii();
    let (negative, digits) = match digits {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, digits),
    };
    if digits.is_empty() || digits.len() > 9 {
        return None;
    }
    let mut value = 0;
    for &digit in digits {
        value = value * 10 + i32::from(digit.is_ascii_digit().then_some(digit)? - b'0');
    }
    Some(if negative { -value } else { value })
}

/// A blank-padded decimal number `mantissa · 10^-decimals`, exactly as written. At most 18 digits.
pub fn decimal(field: &[u8]) -> Option<(i64, u32)> {
    let digits = field.trim_ascii();
    let (negative, digits) = match digits {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, digits),
    };
    if digits.len() > 19 {
        return None;
    }
    let (mut mantissa, mut count, mut point) = (0_i64, 0_u32, None);
    for &byte in digits {
        match byte {
            b'0'..=b'9' if count < 18 => {
                mantissa = mantissa * 10 + i64::from(byte - b'0');
                count += 1;
            }
            b'.' if point.is_none() => point = Some(count),
            _ => return None,
        }
    }
    let decimals = count - point.unwrap_or(count);
    (count > 0).then_some((if negative { -mantissa } else { mantissa }, decimals))
}

/// A blank-padded decimal number, correctly rounded to `f64`.
pub fn real(field: &[u8]) -> Option<f64> {
    /// Powers of ten that `f64` holds exactly.
    const POWERS: [f64; 19] =
        [1., 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18];
    match decimal(field) {
        // Both exact in f64, so that the one division rounds correctly (Clinger's fast path).
        Some((mantissa, decimals)) if mantissa.unsigned_abs() < 1 << 53 => {
            let magnitude = mantissa as f64 / POWERS[decimals as usize];
            // −0.0 is told from 0.0 nowhere in RINEX.
            Some(magnitude)
        }
        _ => scientific(field),
    }
}

/// A blank-padded number with an optional exponent by `E` or FORTRAN's `D`, correctly rounded to `f64`.
pub fn scientific(field: &[u8]) -> Option<f64> {
    let mut buffer = [0_u8; 32];
    let digits = field.trim_ascii();
    let copy = buffer.get_mut(..digits.len())?;
    for (to, &from) in copy.iter_mut().zip(digits) {
        *to = match from {
            b'D' | b'd' => b'E',
            b'0'..=b'9' | b'+' | b'-' | b'.' | b'E' | b'e' => from,
            _ => return None,
        };
    }
    let value: f64 = std::str::from_utf8(copy).ok()?.parse().ok()?;
    value.is_finite().then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_as_the_standard_library_reads_them() {
        for text in ["21695585.691", "-.5", "0.001", "9999999999.999", "1", "-5206.254", "0.123456789012345678", "7."] {
            assert_eq!(real(format!("  {text} ").as_bytes()), Some(text.parse::<f64>().unwrap()), "{text}");
        }
        assert_eq!(scientific(b" .352429196937D-11"), Some(0.352429196937e-11));
        assert_eq!(scientific(b"-1.0d+02 "), Some(-100.0));
    }

    #[test]
    fn what_is_no_number_is_refused() {
        for text in ["", "  ", ".", "-", "1.2.3", "1 2", "12a", "nan", "inf", "1e999", "--1", "\u{e9}"] {
            assert_eq!(real(text.as_bytes()), None, "{text}");
        }
        assert_eq!(integer(b"1234567890"), None);
        assert_eq!(integer(b" -7"), Some(-7));
    }

    #[test]
    fn columns_end_where_the_line_ends() {
        assert_eq!(columns(b"abc", 1, 9), b"bc");
        assert_eq!(columns(b"abc", 5, 9), b"");
        assert_eq!(text(b" M\xfcnchen ", 0, 20), "München");
    }
}
