//! Numbers that a study must give, with their bands.
//!
//! A number outside of its band by less than two of its standard errors is undecided; only those beyond count as missed.

use super::statistics::Estimate;

/// A number and where it must lie.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// What it is.
    pub quantity: String,
    /// The number.
    pub value: Estimate,
    /// Smallest value that is accepted.
    pub low: f64,
    /// Largest value that is accepted.
    pub high: f64,
}

/// Where a number lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// In its band.
    Inside,
    /// Not, but within two standard errors of it.
    Undecided,
    /// Farther off, or not a number.
    Outside,
}

impl Verdict {
    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Inside => "inside",
            Self::Undecided => "undecided",
            Self::Outside => "OUTSIDE",
        }
    }
}

impl Line {
    /// A number that is not uncertain.
    pub fn exact(quantity: String, value: f64, low: f64, high: f64) -> Self {
        Self { quantity, value: Estimate { value, standard_error: 0.0 }, low, high }
    }

    /// Where it lies.
    pub fn verdict(&self) -> Verdict {
        let Estimate { value, standard_error } = self.value;
        let margin = if standard_error.is_finite() { 2.0 * standard_error } else { 0.0 };
        match (value >= self.low && value <= self.high, value >= self.low - margin && value <= self.high + margin) {
            (true, _) => Verdict::Inside,
            (false, true) => Verdict::Undecided,
            (false, false) => Verdict::Outside,
        }
    }
}

/// How many of them lie outside of their bands.
pub fn missed(lines: &[Line]) -> usize {
    lines.iter().filter(|line| line.verdict() == Verdict::Outside).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn verdicts_know_the_standard_error() {
        let line = |value, standard_error| Line {
            quantity: String::new(),
            value: Estimate { value, standard_error },
            low: 0.95,
            high: 1.05,
        };
        assert_eq!(line(0.95, 0.0).verdict(), Verdict::Inside);
        assert_eq!(line(1.05, f64::NAN).verdict(), Verdict::Inside);
        assert_eq!(line(1.06, 0.01).verdict(), Verdict::Undecided);
        assert_eq!(line(1.08, 0.01).verdict(), Verdict::Outside);
        assert_eq!(line(0.94, f64::NAN).verdict(), Verdict::Outside);
        assert_eq!(line(f64::NAN, 1.0).verdict(), Verdict::Outside);
    }
}
