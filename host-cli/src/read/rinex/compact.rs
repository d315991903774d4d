//! Compact RINEX 1.0 and 3.0 (CRINEX) back into the lines of RINEX 2 and 3.
//!
//! Y. Hatanaka, *A Compression Format and Tools for GNSS Observation Data*, Bulletin of the GSI 55 (2008). The header
//! is plain. An epoch is: its epoch line, as characters that differ from the one before (blank: same, `&`: blank);
//! the receiver clock offset; a line a satellite. In these, values are integers (thousandths; the last decimal for
//! the clock), differenced to a growing order up to that which `order&value` announces at the start of an arc:
//! with u⁰ₖ the value at epoch k, uᵐₖ = uᵐ⁻¹ₖ − uᵐ⁻¹ₖ₋₁; an empty field ends the arc. The values are followed by the
//! flags, two a value, again as characters that differ. In CRINEX 1.0 an empty field also blanks its flags, which is
//! in no description but in what RNX2CRX 4.1.0 writes.
//!
//! A damaged line cannot be repaired, since later ones build on it: its satellite is left out and counted until its
//! flags and arcs start afresh, and after a damaged epoch line everything is, until the next one that is complete.

use crate::read::field::{columns, integer};
use crate::read::lines::Lines;
use crate::read::{ReadError, ReadReport, Reason};
use std::collections::VecDeque;

/// Highest order of differences; the format's programs use 3.
const HIGHEST_ORDER: usize = 9;
/// Largest number of columns that we accept in an epoch line: 999 satellites.
const LONGEST_EPOCH: usize = 41 + 3 * 999;

/// Lines of an observation file, expanded if it is compact.
pub struct ExpandedLines {
    lines: Lines,
    expander: Option<Expander>,
    unread: bool,
}

impl ExpandedLines {
    /// Begins with the first line of `lines`, which is current. If it says that the file is compact, goes on to the
    /// first line of RINEX.
    pub fn new(mut lines: Lines, report: &mut ReadReport) -> Result<Self, ReadError> {
        let line = lines.line();
        let expander = if columns(line, 60, 80).trim_ascii() == b"CRINEX VERS   / TYPE" {
            let version_3 = match columns(line, 0, 3) {
                b"1.0" => false,
                b"3.0" => true,
                other => {
                    let version = format!("CRINEX {}", String::from_utf8_lossy(other).trim());
                    return Err(ReadError::Version { file: lines.file().to_owned(), version });
                }
            };
            for _ in 0..2 {
                if !lines.advance(report)? {
                    return Err(super::header::unfinished(&lines));
                }
            }
            Some(Expander::new(version_3))
        } else {
            None
        };
        Ok(Self { lines, expander, unread: false })
    }

    /// The lines as they are in the file; for the header, which is never compact.
    pub fn header_lines(&mut self) -> &mut Lines {
        &mut self.lines
    }

    /// Tells a header line to the expander, which needs the numbers of observation types.
    pub fn observe_header(&mut self) {
        if let Some(expander) = &mut self.expander {
            expander.observe_header(self.lines.line());
        }
    }

    /// As [`Lines::advance`].
    pub fn advance(&mut self, report: &mut ReadReport) -> Result<bool, ReadError> {
        if std::mem::take(&mut self.unread) {
            return Ok(true);
        }
        match &mut self.expander {
            Some(expander) => expander.advance(&mut self.lines, report),
            None => self.lines.advance(report),
        }
    }

    /// As [`Lines::line`].
    pub fn line(&self) -> &[u8] {
        match &self.expander {
            Some(expander) => &expander.line,
            None => self.lines.line(),
        }
    }

    /// As [`Lines::number`]; of the line of the compact file.
    pub fn number(&self) -> u64 {
        self.lines.number()
    }

    /// As [`Lines::unread`].
    pub fn unread(&mut self) {
        self.unread = true;
    }
}

/// What must be known of the epochs before.
struct Expander {
    version_3: bool,
    /// Number of observation types by letter of the satellite system; by any letter in RINEX 2.
    types: [usize; 256],
    /// The last epoch line; empty if there is none to build on.
    epoch: Vec<u8>,
    clock: Option<Arc>,
    satellites: Vec<Satellite>,
    /// Expanded lines to come.
    queue: VecDeque<Vec<u8>>,
    /// The current expanded line.
    line: Vec<u8>,
    /// Event lines to come, which are not compact.
    verbatim: usize,
}

/// The differences of a value, u⁰ … uᵐ.
#[derive(Clone, Copy)]
struct Arc {
    order: usize,
    highest: usize,
    differences: [i64; HIGHEST_ORDER + 1],
}

#[derive(Clone)]
struct Satellite {
    name: [u8; 3],
    arcs: Vec<Option<Arc>>,
    flags: Vec<u8>,
    /// A line of it was damaged: nothing more can be said until it is forgotten.
    lost: bool,
}

/// The text cannot be expanded.
struct Damaged;

impl Expander {
    fn new(version_3: bool) -> Self {
        Self {
            version_3,
            types: [0; 256],
            epoch: Vec::new(),
            clock: None,
            satellites: Vec::new(),
            queue: VecDeque::new(),
            line: Vec::new(),
            verbatim: 0,
        }
    }

    fn observe_header(&mut self, line: &[u8]) {
        let count = |start, end| integer(columns(line, start, end)).and_then(|count| usize::try_from(count).ok());
        match columns(line, 60, 80).trim_ascii() {
            b"# / TYPES OF OBSERV" => {
                if let Some(count) = count(0, 6) {
                    self.types = [count; 256];
                }
            }
            b"SYS / # / OBS TYPES" => {
                if let (Some(&letter @ b'A'..=b'Z'), Some(count)) = (line.first(), count(3, 6)) {
                    self.types[usize::from(letter)] = count;
                }
            }
            _ => {}
        }
    }

    /// Columns of the flag, the number of satellites and their list in an epoch line.
    fn epoch_columns(&self) -> (usize, usize, usize) {
        if self.version_3 { (31, 32, 41) } else { (28, 29, 32) }
    }

    fn advance(&mut self, lines: &mut Lines, report: &mut ReadReport) -> Result<bool, ReadError> {
        while self.queue.is_empty() {
            if !lines.advance(report)? {
                return Ok(false);
            }
            if self.verbatim > 0 {
                self.verbatim -= 1;
                self.observe_header(lines.line());
                self.queue.push_back(lines.line().to_vec());
            } else {
                self.expand_epoch(lines, report)?;
            }
        }
        self.line = self.queue.pop_front().unwrap_or_default();
        Ok(true)
    }

    /// Expands the epoch that begins at the current line.
    fn expand_epoch(&mut self, lines: &mut Lines, report: &mut ReadReport) -> Result<(), ReadError> {
        let (flag_column, count_column, list_column) = self.epoch_columns();
        let complete = lines.line().first() == Some(if self.version_3 { &b'>' } else { &b'&' });
        if complete {
            self.epoch.clear();
            self.satellites.clear();
            self.clock = None;
        }
        let readable = complete || !self.epoch.is_empty();
        differ(&mut self.epoch, lines.line());
        if complete && !self.version_3 {
            self.epoch[0] = b' ';
        }
        self.epoch.truncate(LONGEST_EPOCH);
        let flag = self.epoch.get(flag_column).copied();
        let count = integer(columns(&self.epoch, count_column, count_column + 3)).and_then(|n| usize::try_from(n).ok());
        let (true, Some(flag), Some(count)) = (readable, flag, count) else {
            report.drop_one(Reason::CompactUnreadable, lines.number());
            self.epoch.clear();
            return Ok(());
        };
        if matches!(flag, b'2'..=b'6') {
            // Events are not compact: their lines follow as they are, and the next epoch line is complete.
            self.queue.push_back(columns(&self.epoch, 0, list_column).to_vec());
            self.verbatim = match flag {
                b'6' if !self.version_3 => count * self.types[0].div_ceil(5),
                _ => count,
            };
            self.epoch.clear();
            return Ok(());
        }
        if self.epoch.len() < list_column + 3 * count {
            report.drop_one(Reason::CompactUnreadable, lines.number());
            self.epoch.clear();
            return Ok(());
        }
        let names: Vec<[u8; 3]> =
            self.epoch[list_column..].chunks_exact(3).take(count).map(|n| [n[0], n[1], n[2]]).collect();
        if !lines.advance(report)? {
            return Ok(());
        }
        let Ok(clock) = self.clock_offset(lines.line()) else {
            report.drop_one(Reason::CompactUnreadable, lines.number());
            self.epoch.clear();
            return Ok(());
        };
        self.queue_epoch_line(&names, &clock);
        let mut before = std::mem::take(&mut self.satellites);
        for name in names {
            if !lines.advance(report)? {
                break;
            }
            if lines.line().first().is_some_and(|first| b">&".contains(first)) {
                // No satellite's line: lines are missing, and this is the next complete epoch line.
                lines.unread();
                break;
            }
            let mut satellite = match before.iter().position(|satellite| satellite.name == name) {
                Some(known) => before.swap_remove(known),
                None => Satellite::new(name, self.types[usize::from(name[0])]),
            };
            // A last line without its end may have lost digits; elsewhere values are differences, not aligned.
            let record = if lines.is_whole() { satellite.expand(lines.line(), self.version_3) } else { Err(Damaged) };
            match record {
                Ok(record) => self.queue_record(name, &record),
                Err(Damaged) => {
                    satellite.lost = true;
                    report.drop_one(Reason::CompactUnreadable, lines.number());
                    self.queue_record(name, &[]);
                }
            }
            self.satellites.push(satellite);
        }
        Ok(())
    }

    /// The receiver clock offset as it stands in the epoch line; nothing if there is none.
    fn clock_offset(&mut self, line: &[u8]) -> Result<Vec<u8>, Damaged> {
        let field = line.trim_ascii();
        let mut text = Vec::new();
        self.clock = if field.is_empty() { None } else { Some(Arc::next(self.clock, field)?) };
        if let Some(clock) = self.clock {
            let (decimals, width) = if self.version_3 { (12, 15) } else { (9, 12) };
            push_decimal(&mut text, clock.differences[0], decimals, width)?;
        }
        Ok(text)
    }

    fn queue_epoch_line(&mut self, names: &[[u8; 3]], clock: &[u8]) {
        if self.version_3 {
            self.queue.push_back([columns(&self.epoch, 0, 41), clock].concat());
            return;
        }
        let (first, others) = names.split_at(names.len().min(12));
        let mut line = [columns(&self.epoch, 0, 32), first.as_flattened()].concat();
        line.resize(68, b' ');
        line.extend_from_slice(clock);
        self.queue.push_back(line);
        for names in others.chunks(12) {
            self.queue.push_back([&[b' '; 32], names.as_flattened()].concat());
        }
    }

    /// Queues the lines of a satellite whose fields of 16 columns are `record`.
    fn queue_record(&mut self, name: [u8; 3], record: &[u8]) {
        if self.version_3 {
            self.queue.push_back([&name, record].concat());
            return;
        }
        for i in 0..self.types[0].div_ceil(5) {
            self.queue.push_back(columns(record, 80 * i, 80 * (i + 1)).to_vec());
        }
    }
}

impl Satellite {
    fn new(name: [u8; 3], types: usize) -> Self {
        Self { name, arcs: vec![None; types], flags: vec![b' '; 2 * types], lost: false }
    }

    /// Expands a line into fields of 16 columns.
    fn expand(&mut self, line: &[u8], version_3: bool) -> Result<Vec<u8>, Damaged> {
        if self.lost {
            return Err(Damaged);
        }
        let mut rest = line;
        for (arc, flags) in self.arcs.iter_mut().zip(self.flags.chunks_exact_mut(2)) {
            let end = rest.iter().position(|&byte| byte == b' ').unwrap_or(rest.len());
            let field = &rest[..end];
            *arc = if field.is_empty() { None } else { Some(Arc::next(*arc, field)?) };
            if arc.is_none() && !version_3 {
                flags.fill(b' ');
            }
            rest = rest.get(end + 1..).unwrap_or(&[]);
        }
        let types = self.arcs.len();
        let flags = rest.trim_ascii_end();
        if flags.len() > 2 * types {
            return Err(Damaged);
        }
        differ(&mut self.flags, flags);
        let mut record = Vec::with_capacity(16 * types);
        for (arc, flags) in self.arcs.iter().zip(self.flags.chunks_exact(2)) {
            match arc {
                Some(arc) => push_decimal(&mut record, arc.differences[0], 3, 14)?,
                None => record.extend_from_slice(&[b' '; 14]),
            }
            record.extend_from_slice(flags);
        }
        Ok(record)
    }
}

impl Arc {
    /// The arc after one more field: `order&value` begins one, a number goes on with `arc`.
    fn next(arc: Option<Self>, field: &[u8]) -> Result<Self, Damaged> {
        if let [order @ b'0'..=b'9', b'&', value @ ..] = field {
            let mut differences = [0; HIGHEST_ORDER + 1];
            differences[0] = whole(value)?;
            return Ok(Self { order: 0, highest: usize::from(order - b'0'), differences });
        }
        let mut arc = arc.ok_or(Damaged)?;
        let before = arc.differences;
        arc.order = (arc.order + 1).min(arc.highest);
        arc.differences[arc.order] = whole(field)?;
        for m in (0..arc.order).rev() {
            arc.differences[m] = before[m].checked_add(arc.differences[m + 1]).ok_or(Damaged)?;
        }
        Ok(arc)
    }
}

fn whole(digits: &[u8]) -> Result<i64, Damaged> {
    std::str::from_utf8(digits).ok().and_then(|digits| digits.parse().ok()).ok_or(Damaged)
}

/// Applies the characters in which a text differs: blank keeps, `&` blanks, all others replace.
fn differ(text: &mut Vec<u8>, difference: &[u8]) {
    if text.len() < difference.len() {
        text.resize(difference.len(), b' ');
    }
    for (old, &new) in text.iter_mut().zip(difference) {
        match new {
            b' ' => {}
            b'&' => *old = b' ',
            new => *old = new,
        }
    }
}

/// Adds `value · 10^-decimals` in digits, right-aligned in `width` columns.
fn push_decimal(text: &mut Vec<u8>, value: i64, decimals: usize, width: usize) -> Result<(), Damaged> {
    let start = text.len();
    let mut rest = value.unsigned_abs();
    // From the last digit on, in reverse.
    for i in 0.. {
        if i == decimals {
            text.push(b'.');
        }
        if i > decimals && rest == 0 {
            break;
        }
        text.push(b'0' + (rest % 10) as u8);
        rest /= 10;
    }
    if value < 0 {
        text.push(b'-');
    }
    if text.len() > start + width {
        return Err(Damaged);
    }
    text.resize(start + width, b' ');
    text[start..].reverse();
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::rinex::samples::{COMPACT_1, COMPACT_3, RINEX_2, RINEX_3, read};

    #[test]
    fn compact_files_are_the_files_that_were_compacted() {
        for (compact, plain) in [(COMPACT_1, RINEX_2), (COMPACT_3, RINEX_3)] {
            let ((epochs, report), (plain_epochs, plain_report)) =
                (read(compact.as_bytes()).unwrap(), read(plain.as_bytes()).unwrap());
            assert_eq!(epochs, plain_epochs);
            let counts = |report: ReadReport| {
                report.dropped.into_iter().map(|(reason, t)| (reason, t.count)).collect::<Vec<_>>()
            };
            assert_eq!(counts(report), counts(plain_report));
        }
    }

    #[test]
    fn differences_are_summed_by_their_order() {
        // Order 3 from 1, 4, 9, 17, 29: first differences 3, 5, 8, 12; second 2, 3, 4; third 1, 1.
        let mut arc = None;
        let values = [&b"3&1"[..], b"3", b"2", b"1", b"1"].map(|field| {
            arc = Arc::next(arc, field).ok();
            arc.unwrap().differences[0]
        });
        assert_eq!(values, [1, 4, 9, 17, 29]);
    }

    #[test]
    fn what_cannot_be_expanded_is_refused() {
        assert!(Arc::next(None, b"5").is_err(), "a difference without a beginning");
        let arc = Arc::next(None, b"3&9223372036854775807").ok();
        assert!(Arc::next(arc, b"1").is_err(), "an overflow");
        assert!(Arc::next(arc, b"x").is_err());
        let long = [b"5 ".repeat(3), b"&".repeat(9)].concat();
        assert!(Satellite::new(*b"G05", 4).expand(&long, true).is_err(), "more flags than values have");
    }

    #[test]
    fn a_damaged_satellite_is_left_out_until_it_begins_afresh() {
        // The second epoch's line of G05.
        let damaged = COMPACT_3.replacen("611724 3058635", "6x1724 3058635", 1);
        assert_ne!(damaged, COMPACT_3);
        let (whole, _) = read(COMPACT_3.as_bytes()).unwrap();
        let (epochs, report) = read(damaged.as_bytes()).unwrap();
        assert_eq!(epochs[0], whole[0]);
        // The writer begins afresh after the event that follows the third epoch.
        assert_eq!(epochs[3..], whole[3..]);
        for (epoch, whole) in epochs.iter().zip(whole).skip(1).take(2) {
            let others: Vec<_> = whole.observations.into_iter().filter(|o| o.satellite.to_string() != "G05").collect();
            assert_eq!(epoch.observations, others);
        }
        assert_eq!(report.count(Reason::CompactUnreadable), 2);
    }

    #[test]
    fn after_a_damaged_epoch_line_nothing_is_made_up() {
        let (whole, _) = read(COMPACT_1.as_bytes()).unwrap();
        let lines: Vec<&str> = COMPACT_1.lines().collect();
        let second = lines.iter().position(|line| line.starts_with("                3")).unwrap();
        let more_than_listed = format!("{:<30}99", lines[second]);
        for replacement in [&[][..], &[more_than_listed.as_str()], &["garbage"]] {
            let mut damaged = lines.clone();
            damaged.splice(second..=second, replacement.iter().copied());
            let (epochs, report) = read((damaged.join("\n") + "\n").as_bytes()).unwrap();
            // The writer begins afresh after the event that follows the second epoch.
            assert!(
                epochs == [&whole[..1], &whole[2..]].concat(),
                "{:?}",
                epochs.iter().map(|e| e.time).collect::<Vec<_>>()
            );
            assert!(report.count(Reason::CompactUnreadable) + report.count(Reason::LineUnreadable) > 0);
        }
    }
}
