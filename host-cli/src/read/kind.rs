//! What a file is, by its content.

use super::error::{FileKind, ReadError};
use super::field::columns;
use super::lines::Lines;
use super::report::ReadReport;
use std::path::Path;

/// What a file is, plain or gzipped, by its first line; `None` for what is not known.
pub fn kind(path: &Path) -> Result<Option<FileKind>, ReadError> {
    let mut lines = Lines::open(path)?;
    let mut report = ReadReport::default();
    Ok(if lines.advance(&mut report)? { kind_of_line(lines.line()) } else { None })
}

/// What a file with this first line is; `None` for what is not known.
pub fn kind_of_line(line: &[u8]) -> Option<FileKind> {
    let has = |label: &[u8]| line.windows(label.len()).any(|part| part == label);
    if has(b"CRINEX VERS   / TYPE") {
        Some(FileKind::Observation)
    } else if super::bias::is_bias_sinex(line) {
        Some(FileKind::Bias)
    } else if has(b"ANTEX VERSION / SYST") {
        Some(FileKind::Antenna)
    } else if matches!(line, [b'#', b'a'..=b'd', b'P' | b'V', ..]) {
        Some(FileKind::PreciseOrbit)
    } else if has(b"RINEX VERSION / TYPE") {
        // (Clock files of version 3.04 have the letter a column later.)
        columns(line, 20, 22).trim_ascii().first().and_then(|letter| match letter {
            b'O' => Some(FileKind::Observation),
            b'N' | b'G' | b'H' | b'L' | b'J' | b'E' => Some(FileKind::Navigation),
            b'M' => Some(FileKind::Meteorology),
            b'C' => Some(FileKind::Clock),
            _ => None,
        })
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_lines_tell_the_kind() {
        for (line, kind) in [
            ("#dP2020  6 25  0  0  0.00000000     289 d+D   IGS14 FIT AIUB", Some(FileKind::PreciseOrbit)),
            ("#cV2020  6 25  0  0  0.00000000      96 ORBIT IGb14 HLM  IGS", Some(FileKind::PreciseOrbit)),
            (
                "     1.4            M                                       ANTEX VERSION / SYST",
                Some(FileKind::Antenna),
            ),
            ("     3.00           C                                       RINEX VERSION / TYPE", Some(FileKind::Clock)),
            (
                "3.04                 C                    G                      RINEX VERSION / TYPE",
                Some(FileKind::Clock),
            ),
            (
                "     3.04           OBSERVATION DATA    M                   RINEX VERSION / TYPE",
                Some(FileKind::Observation),
            ),
            (
                "     3.04           N: GNSS NAV DATA    M: MIXED            RINEX VERSION / TYPE",
                Some(FileKind::Navigation),
            ),
            ("     2.11           X                                       RINEX VERSION / TYPE", None),
            ("# any comment", None),
            ("", None),
        ] {
            assert_eq!(kind_of_line(line.as_bytes()), kind, "{line}");
        }
    }
}
