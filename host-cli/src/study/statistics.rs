//! Statistics over runs: ratios with their standard errors.
//!
//! Epochs of a run are correlated, runs are not. A fraction or mean is therefore a ratio of sums over runs,
//! ```text
//! r = Σ xᵢ / Σ nᵢ,   sd(r) = √( R/(R−1) · Σ (xᵢ − r nᵢ)² ) / Σ nᵢ
//! ```
//! over the R runs (W. G. Cochran, *Sampling Techniques*, 3rd ed. 1977, eq. 6.13), whose standard error takes the
//! correlation within a run into account.

/// A sum and the number of its terms, of one run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tally {
    /// Sum.
    pub sum: f64,
    /// Number of terms.
    pub count: f64,
}

impl Tally {
    /// Adds a term.
    pub fn add(&mut self, term: f64) {
        self.sum += term;
        self.count += 1.0;
    }

    /// Adds a term that is 1 if something is the case and 0 if not.
    pub fn add_case(&mut self, is: bool) {
        self.add(f64::from(u8::from(is)));
    }
}

/// A number from a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The number; NaN if there was nothing to make it of.
    pub value: f64,
    /// Its standard error; NaN for fewer than two runs.
    pub standard_error: f64,
}

impl Estimate {
    /// The ratio of sums over runs.
    pub fn ratio(runs: impl Iterator<Item = Tally> + Clone) -> Self {
        let (sum, count, number) =
            runs.clone().fold((0.0, 0.0, 0.0), |(s, c, n), run| (s + run.sum, c + run.count, n + 1.0));
        let value = sum / count;
        let square: f64 = runs.map(|run| (run.sum - value * run.count).powi(2)).sum();
        Self { value, standard_error: (number / (number - 1.0) * square).sqrt() / count }
    }

    /// Its square root, to first order.
    pub fn sqrt(self) -> Self {
        let value = self.value.sqrt();
        Self { value, standard_error: self.standard_error / (2.0 * value) }
    }

    /// It times a constant.
    pub fn scale(self, factor: f64) -> Self {
        Self { value: factor * self.value, standard_error: factor.abs() * self.standard_error }
    }
}

/// Value and standard error, for two columns.
pub fn both(estimate: Estimate) -> [f64; 2] {
    [estimate.value, estimate.standard_error]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs of equal length: mean and standard error of the mean of (1, 2, 6), by hand.
    #[test]
    fn equal_runs_give_the_mean_and_its_standard_error() {
        let runs = [1.0, 2.0, 6.0].map(|sum| Tally { sum, count: 1.0 });
        let estimate = Estimate::ratio(runs.into_iter());
        assert!((estimate.value - 3.0).abs() < 1e-15);
        assert!((estimate.standard_error - (7.0_f64 / 3.0).sqrt()).abs() < 1e-15);
    }

    /// With n_i in proportion to x_i the ratio has no error.
    #[test]
    fn a_constant_ratio_has_no_error() {
        let runs = [1.0, 2.0, 6.0].map(|sum| Tally { sum, count: 4.0 * sum });
        let estimate = Estimate::ratio(runs.into_iter());
        assert_eq!(estimate, Estimate { value: 0.25, standard_error: 0.0 });
    }

    #[test]
    fn nothing_gives_not_a_number() {
        assert!(Estimate::ratio([Tally::default(); 2].into_iter()).value.is_nan());
        assert!(Estimate::ratio([Tally { sum: 1.0, count: 1.0 }].into_iter()).standard_error.is_nan());
    }

    /// d√x = dx/(2√x).
    #[test]
    fn roots_and_multiples_carry_the_error() {
        let estimate = Estimate { value: 4.0, standard_error: 0.4 }.sqrt().scale(100.0);
        assert_eq!((estimate.value, estimate.standard_error), (200.0, 10.0));
    }

    #[test]
    fn cases_are_counted() {
        let mut tally = Tally::default();
        [true, false, true].into_iter().for_each(|case| tally.add_case(case));
        assert_eq!(tally, Tally { sum: 2.0, count: 3.0 });
    }
}
