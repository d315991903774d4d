//! GPT3's grid file of TU Wien, `gpt3_5.grd` or `gpt3_1.grd`.
//!
//! One line a cell, from north to south and from Greenwich eastwards (0…360° or to 180° and on from −180°): latitude and longitude of the centre `[deg]`, then
//! mean and four amplitudes each of pressure `[Pa]`, temperature `[K]`, humidity `[g/kg]` and lapse rate `[K/km]`; geoid
//! undulation and height `[m]`; mean and amplitudes of a_h and a_w (times 1000), water vapour decrease, mean temperature
//! `[K]` and four gradients (times 1e5). The grid must be whole.

use super::ReadError;
use super::lines::Lines;
use super::report::{ReadReport, Reason};
use std::path::Path;
use surefix_core::gnss::atmosphere::gpt3::{Gpt3Cell, Gpt3Grid, Seasonal};

/// Numbers in a line.
const NUMBERS: usize = 64;

/// The cells of a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Gpt3File {
    step: u8,
    cells: Vec<Gpt3Cell>,
}

impl Gpt3File {
    /// Reads a file, plain or gzipped.
    pub fn open(path: &Path) -> Result<(Self, ReadReport), ReadError> {
        Self::read(Lines::open(path)?)
    }

    fn read(mut lines: Lines) -> Result<(Self, ReadReport), ReadError> {
        let mut report = ReadReport::new(lines.file());
        let (mut centres, mut cells) = (Vec::new(), Vec::new());
        while lines.advance(&mut report)? {
            let line = lines.line();
            if line.first() == Some(&b'%') || line.trim_ascii().is_empty() {
                continue;
            }
            match cell(line) {
                Some((centre, cell)) => {
                    centres.push(centre);
                    cells.push(cell);
                }
                None => report.drop_one(Reason::RecordUnreadable, lines.number()),
            }
        }
        report.records = cells.len() as u64;
        let step = match centres.first() {
            Some([_, first]) if is_whole(&centres, 2.0 * first) => (2.0 * first) as u8,
            _ => {
                return Err(ReadError::Header {
                    file: lines.file().to_owned(),
                    line: 1,
                    problem: "this is not a whole grid of GPT3".to_owned(),
                    remedy: "give gpt3_5.grd or gpt3_1.grd as TU Wien publishes them",
                });
            }
        };
        Ok((Self { step, cells }, report))
    }
}

impl Gpt3Grid for Gpt3File {
    fn step(&self) -> u8 {
        self.step
    }

    fn cell(&self, row: u16, column: u16) -> Option<Gpt3Cell> {
        let columns = 360 / usize::from(self.step);
        let column = usize::from(column);
        (column < columns).then(|| self.cells.get(usize::from(row) * columns + column).copied())?
    }
}

/// Whether a file with this first line is a grid of GPT3 (not of GPT2w, which has no gradients).
pub fn is_gpt3(first_line: &[u8]) -> bool {
    let has = |part: &[u8]| first_line.windows(part.len()).any(|window| window == part);
    first_line.starts_with(b"%") && has(b"undu") && has(b"Gn_h")
}

/// Whether the centres are those of a grid of `step` degrees that covers the Earth.
fn is_whole(centres: &[[f64; 2]], step: f64) -> bool {
    if step.fract() != 0.0 || !(1.0..=90.0).contains(&step) || 180.0 % step != 0.0 {
        return false;
    }
    let (rows, columns) = ((180.0 / step) as usize, (360.0 / step) as usize);
    let expected =
        |i: usize| [90.0 - (i / columns) as f64 * step - step / 2.0, (i % columns) as f64 * step + step / 2.0];
    centres.len() == rows * columns && centres.iter().enumerate().all(|(i, centre)| *centre == expected(i))
}

/// Latitude and longitude of the centre, and the values.
fn cell(line: &[u8]) -> Option<([f64; 2], Gpt3Cell)> {
    let numbers: Vec<f64> = std::str::from_utf8(line)
        .ok()?
        .split_ascii_whitespace()
        .map(|word| word.parse().ok().filter(|value: &f64| value.is_finite()))
        .collect::<Option<_>>()?;
    let numbers: [f64; NUMBERS] = numbers.try_into().ok()?;
    // (Divided as in TU Wien's programs, not multiplied by the inverse.)
    let seasonal = |first: usize, by: f64| -> Seasonal { std::array::from_fn(|i| numbers[first + i] / by) };
    let cell = Gpt3Cell {
        pressure: seasonal(2, 1.0),
        temperature: seasonal(7, 1.0),
        humidity: seasonal(12, 1e3),
        lapse_rate: seasonal(17, 1e3),
        undulation: numbers[22],
        height: numbers[23],
        mapping: [seasonal(24, 1e3), seasonal(29, 1e3)],
        decrease: seasonal(34, 1.0),
        mean_temperature: seasonal(39, 1.0),
        gradients: [44, 49, 54, 59].map(|first| seasonal(first, 1e5)),
    };
    Some(([numbers[0], numbers[1].rem_euclid(360.0)], cell))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::fmt::Write;
    use std::io::Cursor;

    /// A grid of 90°, its numbers counting up from 0 but for the centres.
    fn sample() -> String {
        let mut text = String::from("%  lat    lon   p:a0  undu  Gn_h:a0\n");
        for (latitude, longitude) in
            [45.0, -45.0].into_iter().flat_map(|row| [45.0, 135.0, 225.0, 315.0].map(|column| (row, column)))
        {
            write!(text, "{latitude:6.1} {longitude:6.1}").unwrap();
            (0..62).for_each(|i| write!(text, " {i}").unwrap());
            text += "\n";
        }
        text
    }

    fn read(text: impl AsRef<[u8]>) -> Result<(Gpt3File, ReadReport), ReadError> {
        Gpt3File::read(Lines::new("a.grd", Cursor::new(text.as_ref().to_vec())))
    }

    #[test]
    fn columns_are_where_they_should_be() {
        let (grid, report) = read(sample()).unwrap();
        assert_eq!((grid.step(), report.records), (90, 8));
        assert!(report.dropped.is_empty() && is_gpt3(sample().lines().next().unwrap().as_bytes()));
        let cell = grid.cell(1, 3).unwrap();
        assert_eq!((cell.pressure[0], cell.humidity[4], cell.undulation, cell.height), (0.0, 0.014, 20.0, 21.0));
        assert_eq!((cell.mapping[1][0], cell.mean_temperature[0], cell.gradients[3][4]), (0.027, 37.0, 61e-5));
        assert_eq!((grid.cell(2, 0), grid.cell(0, 4)), (None, None));
        // As TU Wien's own files count longitudes.
        let western = sample().replace(" 225.0", "-135.0").replace(" 315.0", " -45.0");
        assert_eq!(read(western).unwrap().0, grid);
    }

    #[test]
    fn grids_that_are_not_whole_are_refused() {
        let text = sample();
        let cut: String = text.lines().take(8).map(|line| format!("{line}\n")).collect();
        assert!(matches!(read(cut), Err(ReadError::Header { .. })));
        assert!(read(text.replace(" 61\n", " x\n")).is_err() && read("").is_err());
    }

    proptest! {
        #[test]
        fn no_bytes_panic(
            bytes in prop::collection::vec(any::<u8>(), 0..500),
            edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..4),
        ) {
            let _ = read(&bytes);
            let mut text = sample().into_bytes();
            for (at, byte) in edits {
                let at = at.index(text.len());
                text[at] = byte;
            }
            let _ = read(&text);
        }
    }
}
