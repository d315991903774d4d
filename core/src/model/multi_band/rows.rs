//! Rows of the multi-band model, sparse, and their noise.
//!
//! | rows of the paper, in this order | number | are |
//! |---|---|---|
//! | for each of L1, IF₁₂, IF₁₅: code, phase, Doppler | 9 (N_s − 1) | [`MultiBandModel::linear_entries`] of [`Bands::ionosphere_free`](super::Bands::ionosphere_free) |
//! | virtual measurements of I, T and, in single differences, clocks | 2 or 3 N_s | the state itself |
//!
//! The noise of two differences of combinations c and c′ of one kind of signal is (cᵀc′) f σ² (M Mᵀ)_ij.
//!
//! Cost: one call for each coefficient, at most nine a row. Panic contract: none; rows that are not there are empty.

use super::combination::{BANDS, Combination};
use super::{ClockRows, Layout, MultiBandModel};
use crate::linalg::dot;
use crate::model::partially_linear::Nonlinear;

/// A kind of signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signal {
    /// P, pseudorange `[m]`.
    Code,
    /// Φ, carrier phase `[m]`.
    Phase,
    /// Γ, minus the range rate `[m/s]`.
    Doppler,
}

impl Signal {
    /// In the order of the rows.
    pub const ALL: [Self; 3] = [Self::Code, Self::Phase, Self::Doppler];
}

/// (M Mᵀ)_ij: 2 on the diagonal, 1 elsewhere.
pub(super) fn difference_covariance(i: usize, j: usize) -> f64 {
    if i == j { 2.0 } else { 1.0 }
}

impl MultiBandModel<'_> {
    /// Number of rows of the paper: 101 for ten satellites in double differences, 111 in single ones.
    pub fn rows(&self) -> usize {
        self.signal_rows() + self.virtual_rows()
    }

    /// Rows of signals; they come first.
    pub fn signal_rows(&self) -> usize {
        Signal::ALL.len() * BANDS * self.layout().differences()
    }

    /// Rows of virtual measurements.
    pub fn virtual_rows(&self) -> usize {
        let n = self.satellites.len();
        match (self.layout().clocks, self.clock_rows) {
            (false, _) => 2 * n,
            (true, ClockRows::All) => 3 * n,
            (true, ClockRows::First) => 2 * n + n.min(1),
        }
    }

    /// Combination, signal and difference of a row of the paper's order; `None` beyond the signals.
    fn signal_row(&self, row: usize) -> Option<(Combination, Signal, usize)> {
        let differences = self.layout().differences();
        let group = row.checked_div(differences)?;
        let combination = *self.bands.ionosphere_free().get(group / Signal::ALL.len())?;
        Some((combination, *Signal::ALL.get(group % Signal::ALL.len())?, row % differences))
    }

    /// State and variance `[m²]` of a virtual measurement, counted from 0; `None` beyond them.
    pub fn virtual_row(&self, row: usize) -> Option<(usize, f64)> {
        let n = self.satellites.len();
        let kind = row.checked_div(n).filter(|_| row < self.virtual_rows())?;
        let variance = [self.variances.ionosphere, self.variances.troposphere, self.variances.clock];
        Some((self.layout().bias(kind, row % n), *variance.get(kind)?))
    }

    /// Factor of M ρ, or for Doppler of −M ρ̇, in a combination of bands.
    pub fn geometry_factor(&self, combination: &Combination) -> f64 {
        self.bands.geometry(combination)
    }

    /// Calls `entry` with each linear state and coefficient of a difference of a combination of bands.
    pub fn linear_entries(
        &self,
        signal: Signal,
        combination: &Combination,
        difference: usize,
        entry: &mut dyn FnMut(usize, f64),
    ) {
        let layout = self.layout();
        let (geometry, ionosphere) = (self.bands.geometry(combination), self.bands.ionosphere(combination));
        let mut differ = |state: fn(&Layout, usize) -> usize, coefficient: f64| {
            if coefficient != 0.0 {
                for (satellite, coefficient) in [(0, coefficient), (difference + 1, -coefficient)] {
                    let bias = state(&layout, satellite);
                    let rate = signal == Signal::Doppler;
                    entry(if rate { layout.rate_of_bias(bias) } else { bias }, coefficient);
                }
            }
        };
        let (for_ionosphere, for_delay) = match signal {
            Signal::Code => (1.0, 1.0),
            Signal::Phase => (-1.0, 1.0),
            Signal::Doppler => (1.0, -1.0),
        };
        differ(Layout::ionosphere, for_ionosphere * ionosphere);
        differ(Layout::troposphere, for_delay * geometry);
        if layout.clocks {
            differ(Layout::clock, -for_delay * geometry);
        }
        if signal == Signal::Phase {
            for (band, (&coefficient, wavelength)) in combination.iter().zip(self.bands.wavelengths()).enumerate() {
                if coefficient != 0.0 {
                    entry(layout.ambiguity(band, difference), coefficient * wavelength);
                }
            }
        }
    }

    /// Calls `entry` with each state and coefficient of a row of C, in the paper's order.
    pub fn row(&self, row: usize, entry: &mut dyn FnMut(usize, f64)) {
        match self.signal_row(row) {
            Some((combination, signal, difference)) => self.linear_entries(signal, &combination, difference, entry),
            None => {
                if let Some((state, _)) = row.checked_sub(self.signal_rows()).and_then(|row| self.virtual_row(row)) {
                    entry(state, 1.0);
                }
            }
        }
    }

    /// g of a row of the paper's order, from the values of [`Nonlinear::evaluate`]; 0 for virtual measurements. With a
    /// column of ∂/∂z in their place it is that of ∂g/∂z.
    pub fn nonlinear_part(&self, row: usize, values: &[f64]) -> f64 {
        self.signal_row(row).map_or(0.0, |(combination, signal, difference)| {
            self.geometry_factor(&combination) * self.nonlinear_value(signal, difference, values)
        })
    }

    /// That value of [`Nonlinear::evaluate`] which a signal sees.
    pub fn nonlinear_value(&self, signal: Signal, difference: usize, values: &[f64]) -> f64 {
        let first = if signal == Signal::Doppler { self.outputs() / 2 } else { 0 };
        values.get(first + difference).copied().unwrap_or_default()
    }

    /// σ² of a single difference of one band: what M Mᵀ multiplies, with the base's noise where there is a base.
    pub fn signal_variance(&self, signal: Signal) -> f64 {
        let variance = match signal {
            Signal::Code => self.variances.code,
            Signal::Phase => self.variances.phase,
            Signal::Doppler => self.variances.doppler,
        };
        if self.base.is_some() { 2.0 * variance } else { variance }
    }

    /// R_ij in the paper's order.
    pub fn noise(&self, i: usize, j: usize) -> f64 {
        match (self.signal_row(i), self.signal_row(j)) {
            (Some((a, signal, difference)), Some((b, other_signal, other))) if signal == other_signal => {
                dot(&a, &b) * self.signal_variance(signal) * difference_covariance(difference, other)
            }
            (None, None) if i == j => {
                let row = i.checked_sub(self.signal_rows()).and_then(|row| self.virtual_row(row));
                row.map_or(0.0, |(_, variance)| variance)
            }
            _ => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::model;
    use super::*;
    use nalgebra::{DMatrix, DVector, Vector3};

    fn base() -> Option<Vector3<f64>> {
        Some(Vector3::new(-6000.0, 8000.0, 0.0))
    }

    /// h(x) of the paper's Fig. 1, signal by signal and satellite by satellite, then differenced and combined.
    #[test]
    fn rows_equal_the_observation_equations() {
        for base in [None, base()] {
            let model = model(base);
            let layout = model.layout();
            let x: Vec<f64> = (0..layout.states()).map(|i| (0.7 * i as f64).sin()).collect();
            let mut values = [0.0; 6];
            model.evaluate(&x[..4], &mut values);
            let differ = |bias: usize, i: usize| x[bias] - x[bias + 1 + i];
            for row in 0..model.signal_rows() {
                let (group, i) = (row / 3, row % 3);
                let signal = Signal::ALL[group % 3];
                let rate = if signal == Signal::Doppler { layout.satellites } else { 0 };
                let ionosphere = differ(layout.ionosphere(0) + rate, i);
                let troposphere = differ(layout.troposphere(0) + rate, i);
                let clock = if layout.clocks { differ(layout.clock(0) + rate, i) } else { 0.0 };
                let on = |band: usize| {
                    let ratio = (model.bands.wavelength(band) / model.bands.wavelength(0)).powi(2);
                    match signal {
                        Signal::Code => values[i] + troposphere - clock + ratio * ionosphere,
                        Signal::Phase => {
                            let ambiguity = x[layout.ambiguity(band, i)];
                            values[i] + troposphere - clock - ratio * ionosphere
                                + model.bands.wavelength(band) * ambiguity
                        }
                        Signal::Doppler => values[3 + i] - troposphere + clock + ratio * ionosphere,
                    }
                };
                let combined = match group / 3 {
                    0 => on(0),
                    d => on(0) - (model.bands.wavelength(0) / model.bands.wavelength(d)).powi(2) * on(d),
                };
                let mut linear = 0.0;
                model.row(row, &mut |state, coefficient| linear += coefficient * x[state]);
                let computed = model.nonlinear_part(row, &values) + linear;
                assert!((computed - combined).abs() < 1e-9 * values[0].abs(), "{row}: {computed} {combined}");
            }
        }
    }

    /// R = T R_raw Tᵀ for differences of independent noises, written out.
    #[test]
    fn noise_is_that_of_combined_differences() {
        let model = model(base());
        let (bands, variance) = (model.bands.ionosphere_free(), model.variances);
        let m = DMatrix::from_fn(3, 4, |i, j| if j == 0 { 1.0 } else { -f64::from(u8::from(j == i + 1)) });
        let b = DMatrix::from_fn(3, 3, |i, j| bands[i][j]);
        let sigma = DMatrix::from_diagonal(&DVector::from_vec(vec![variance.code, variance.phase, variance.doppler]));
        let expected = (&b * b.transpose()).kronecker(&sigma).kronecker(&(2.0 * &m * m.transpose()));
        for i in 0..model.signal_rows() {
            for j in 0..model.signal_rows() {
                assert!((model.noise(i, j) - expected[(i, j)]).abs() < 1e-15);
            }
            assert_eq!(model.noise(i, model.signal_rows()), 0.0);
        }
    }

    #[test]
    fn virtual_rows_see_one_state_each() {
        let all = model(None);
        let first = MultiBandModel { clock_rows: ClockRows::First, ..all };
        assert_eq!((all.rows(), first.rows(), model(base()).rows()), (27 + 12, 27 + 9, 27 + 8));
        for (model, row, state) in [(&all, 27, 13), (&all, 31, 21), (&all, 38, 32), (&first, 35, 29)] {
            let mut seen = vec![];
            model.row(row, &mut |state, coefficient| seen.push((state, coefficient)));
            assert_eq!(seen, [(state, 1.0)]);
        }
        assert_eq!(all.noise(38, 38), all.variances.clock);
        assert_eq!((first.virtual_row(9), first.noise(99, 99), all.virtual_row(12)), (None, 0.0, None));
        first.row(usize::MAX, &mut |_, _| panic!("no such row"));
    }
}
