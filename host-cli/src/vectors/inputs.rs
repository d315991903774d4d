//! Typed access to the inputs of a case, with errors that name what is missing.

use serde_json::Value;
use surefix_core::gnss::time::GpsTime;
use thiserror::Error;

/// Why a case cannot be recomputed.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CaseError {
    /// An input is missing or of another type.
    #[error("input \"{key}\" is not {wanted}")]
    Input {
        /// Its name.
        key: String,
        /// What it should be.
        wanted: &'static str,
    },
    /// An input cannot be what it says it is.
    #[error("{0}")]
    Absurd(String),
}

/// A JSON object with named inputs.
#[derive(Clone, Copy)]
pub struct Inputs<'a>(pub &'a Value);

impl<'a> Inputs<'a> {
    fn get<T>(&self, key: &str, wanted: &'static str, read: impl Fn(&'a Value) -> Option<T>) -> Result<T, CaseError> {
        let missing = || CaseError::Input { key: key.to_owned(), wanted };
        self.0.get(key).and_then(read).ok_or_else(missing)
    }

    /// A number.
    pub fn number(&self, key: &str) -> Result<f64, CaseError> {
        self.get(key, "a number", Value::as_f64)
    }

    /// A whole number.
    pub fn integer(&self, key: &str) -> Result<i32, CaseError> {
        self.get(key, "a whole number", |v| i32::try_from(v.as_i64()?).ok())
    }

    /// A string.
    pub fn text(&self, key: &str) -> Result<&'a str, CaseError> {
        self.get(key, "a string", Value::as_str)
    }

    /// `N` numbers.
    pub fn numbers<const N: usize>(&self, key: &str) -> Result<[f64; N], CaseError> {
        self.get(key, "a list of numbers of the right length", |v| numbers(v)?.try_into().ok())
    }

    /// A list of rows of `N` numbers.
    pub fn rows<const N: usize>(&self, key: &str) -> Result<Vec<[f64; N]>, CaseError> {
        self.get(key, "a list of rows of numbers", |v| {
            v.as_array()?.iter().map(|row| numbers(row)?.try_into().ok()).collect()
        })
    }

    /// Numbers, however many.
    pub fn list(&self, key: &str) -> Result<Vec<f64>, CaseError> {
        self.get(key, "a list of numbers", numbers)
    }

    /// `n` numbers.
    pub fn list_of(&self, key: &str, n: usize) -> Result<Vec<f64>, CaseError> {
        self.get(key, "a list of numbers of the right length", |v| numbers(v).filter(|list| list.len() == n))
    }

    /// A matrix: rows, columns, and its entries row by row.
    pub fn matrix(&self, key: &str) -> Result<(usize, usize, Vec<f64>), CaseError> {
        self.get(key, "a list of equally long rows of numbers", |v| {
            let rows: Vec<Vec<f64>> = v.as_array()?.iter().map(numbers).collect::<Option<_>>()?;
            let cols = rows.first().map_or(0, Vec::len);
            let equal = rows.iter().all(|row| row.len() == cols);
            equal.then(|| (rows.len(), cols, rows.concat()))
        })
    }

    /// A square matrix: its dimension, and its entries row by row.
    pub fn square(&self, key: &str) -> Result<(usize, Vec<f64>), CaseError> {
        let n = self.get(key, "a matrix", Value::as_array)?.len();
        Ok((n, self.square_of(key, n)?))
    }

    /// The entries of an n × n matrix, row by row.
    pub fn square_of(&self, key: &str, n: usize) -> Result<Vec<f64>, CaseError> {
        let (rows, cols, entries) = self.matrix(key)?;
        let wrong = || CaseError::Input { key: key.to_owned(), wanted: "a square matrix of the right size" };
        if (rows, cols) == (n, n) { Ok(entries) } else { Err(wrong()) }
    }

    /// A nested object.
    pub fn object(&self, key: &str) -> Result<Inputs<'a>, CaseError> {
        self.get(key, "an object", |v| v.is_object().then_some(Inputs(v)))
    }

    /// A list of objects.
    pub fn objects(&self, key: &str) -> Result<Vec<Inputs<'a>>, CaseError> {
        self.get(key, "a list of objects", |v| Some(v.as_array()?.iter().map(Inputs).collect()))
    }

    /// What [`str::parse`] makes of a string.
    pub fn parsed<T: std::str::FromStr<Err: std::fmt::Display>>(&self, key: &str) -> Result<T, CaseError> {
        let text = self.text(key)?;
        text.parse().map_err(|error| CaseError::Absurd(format!("input \"{key}\" = \"{text}\": {error}")))
    }

    /// A time given as `gps_week` and `tow`.
    pub fn time(&self) -> Result<GpsTime, CaseError> {
        Ok(GpsTime::from_week_tow(self.integer("gps_week")?, self.number("tow")?))
    }

    /// A time given as `[week, tow]` under one key.
    pub fn time_at(&self, key: &str) -> Result<GpsTime, CaseError> {
        let [week, tow] = self.numbers(key)?;
        Ok(GpsTime::from_week_tow(week as i32, tow))
    }
}

fn numbers(value: &Value) -> Option<Vec<f64>> {
    value.as_array()?.iter().map(Value::as_f64).collect()
}
