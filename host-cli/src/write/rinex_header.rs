//! Header lines of RINEX files.

use std::io::{self, Write};

/// Version that we write: the last 3.0x whose GLONASS records have three orbit lines.
pub(super) const VERSION: &str = "3.04";

/// Writes a header line: content in columns 1–60, label in 61–80. Longer content is cut, non-ASCII becomes `?`.
pub(super) fn header_line(out: &mut impl Write, label: &str, content: &str) -> io::Result<()> {
    let content: String = content.chars().map(|c| if c == ' ' || c.is_ascii_graphic() { c } else { '?' }).collect();
    writeln!(out, "{content:<60.60}{label:<20}")
}

/// Writes the two lines with which every file begins. `kind` is the file type as it stands in column 21.
pub(super) fn first_lines(out: &mut impl Write, kind: &str) -> io::Result<()> {
    header_line(out, "RINEX VERSION / TYPE", &format!("{VERSION:>9}           {kind:<20}M: MIXED"))?;
    header_line(out, "PGM / RUN BY / DATE", &format!("surefix {:<12}", env!("CARGO_PKG_VERSION")))
}
