//! Measurement rows with a free common term, and the same without it.
//!
//! ```text
//! yᵢ = hᵢ x + c + eᵢ,   eᵢ ~ N(0, Rᵢ),  c free     →     yᵢ − ȳ = (hᵢ − h̄) x + e,   e ~ N(0, Rᵢ + 1/W)
//! ```
//! with weighted means over the rows before, W the sum of their weights: exact, and independent of each other; the same
//! as [`surefix_core::filter::common_term`] for any number of states, all differences of an epoch at once.

use surefix_core::filter::update::Rows;

/// One row on a few states.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// State and coefficient, of which the first `len` count.
    pub entries: [(usize, f64); 5],
    /// Number of entries.
    pub len: usize,
    /// The residual `[m]` or `[m/s]`.
    pub value: f64,
    /// How its variance compares with that at the zenith.
    pub weight: f64,
    /// How far it is trusted: its variance was divided by this.
    pub trust: f64,
    /// Its variance.
    pub variance: f64,
    /// Its link, in the order of the tape.
    pub link: usize,
}

impl Row {
    /// Those that count.
    pub fn entries(&self) -> &[(usize, f64)] {
        &self.entries[..self.len]
    }

    /// What is left of the residual for a state x.
    pub fn residual(&self, x: &[f64]) -> f64 {
        self.value - self.entries().iter().map(|&(i, h)| h * x[i]).sum::<f64>()
    }
}

/// Differences that are independent of each other.
#[derive(Clone, Debug, Default)]
pub struct Differences {
    ends: Vec<usize>,
    entries: Vec<(usize, f64)>,
    /// What each is.
    pub values: Vec<f64>,
    /// Variance of each.
    pub variances: Vec<f64>,
    means: Vec<f64>,
    touched: Vec<usize>,
}

impl Differences {
    /// None yet, of so many states.
    pub fn reset(&mut self, states: usize) {
        self.ends.clear();
        self.entries.clear();
        self.values.clear();
        self.variances.clear();
        self.means.clear();
        self.means.resize(states, 0.0);
    }

    /// Appends the differences of rows that share a common term: one less than there are rows.
    pub fn push(&mut self, rows: &[Row]) {
        let (mut weights, mut sum) = (0.0, 0.0);
        for row in rows {
            let weight = 1.0 / row.variance;
            if weights > 0.0 {
                let start = self.entries.len();
                self.entries.extend(self.touched.iter().map(|&i| (i, -self.means[i] / weights)));
                for &(i, h) in row.entries() {
                    match self.entries[start..].iter_mut().find(|(j, _)| *j == i) {
                        Some((_, difference)) => *difference += h,
                        None => self.entries.push((i, h)),
                    }
                }
                self.ends.push(self.entries.len());
                self.values.push(row.value - sum / weights);
                self.variances.push(row.variance + 1.0 / weights);
            }
            for &(i, h) in row.entries() {
                if self.means[i] == 0.0 && !self.touched.contains(&i) {
                    self.touched.push(i);
                }
                self.means[i] += h * weight;
            }
            sum += row.value * weight;
            weights += weight;
        }
        for i in self.touched.drain(..) {
            self.means[i] = 0.0;
        }
    }

    /// Number of differences.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// What is left of a difference for a state x.
    pub fn innovation(&self, row: usize, x: &[f64]) -> f64 {
        self.values[row] - self.row(row).iter().map(|&(i, h)| h * x[i]).sum::<f64>()
    }

    fn row(&self, row: usize) -> &[(usize, f64)] {
        let start = if row == 0 { 0 } else { self.ends[row - 1] };
        &self.entries[start..self.ends[row]]
    }
}

impl Rows<f64> for Differences {
    fn for_each(&self, row: usize, entry: &mut dyn FnMut(usize, f64)) {
        self.row(row).iter().for_each(|&(i, h)| entry(i, h));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use surefix_core::filter::common_term::CommonTerm;

    /// The same as the core's elimination of a common term, for two groups one after the other.
    #[test]
    fn differences_are_those_of_the_core() {
        let row = |states: [usize; 3], value: f64, variance: f64| {
            let mut entries = [(0, 0.0); 5];
            for (i, (entry, state)) in entries.iter_mut().zip(states).enumerate() {
                *entry = (state, 0.3 * value - i as f64);
            }
            Row { entries, len: 3, value, weight: 1.0, trust: 1.0, variance, link: 0 }
        };
        let groups = [
            vec![row([0, 1, 3], 1.5, 0.2), row([0, 1, 4], -0.5, 0.1), row([0, 1, 3], 0.7, 2.0)],
            vec![row([2, 1, 0], 9.0, 1.0), row([0, 4, 2], 8.0, 0.5)],
        ];
        let mut differences = Differences::default();
        differences.reset(5);
        let mut common = CommonTerm::<f64, 5>::new();
        let mut number = 0;
        for rows in &groups {
            differences.push(rows);
            common.reset();
            for row in rows {
                let Some(expected) = common.difference(5, row.entries(), row.value, row.variance) else { continue };
                let mut dense = [0.0; 5];
                differences.for_each(number, &mut |i, h| dense[i] += h);
                assert!(dense.iter().zip(expected.row).all(|(a, b)| (a - b).abs() < 1e-14), "{dense:?} {expected:?}");
                assert!((differences.values[number] - expected.measurement).abs() < 1e-14);
                assert!((differences.variances[number] - expected.variance).abs() < 1e-14);
                let x = [0.4, -1.0, 2.0, 0.1, 3.0];
                let innovation = expected.measurement - expected.row.iter().zip(&x).map(|(h, x)| h * x).sum::<f64>();
                assert!((differences.innovation(number, &x) - innovation).abs() < 1e-13);
                number += 1;
            }
        }
        assert_eq!((number, differences.len(), differences.is_empty()), (3, 3, false));
        differences.reset(5);
        differences.push(&groups[0][..1]);
        assert!(differences.is_empty(), "a row alone says nothing");
    }
}
