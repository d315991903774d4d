//! The measurement update of the multi-band model, and what its residuals say of the noise.
//!
//! Groups of rows ([`super::groups`]) follow one another, each with the noise f σ² M Mᵀ. Where a statistical rule finds an
//! Ω that counts, it ties all groups together and they are taken at once; an Ω below [`NEGLIGIBLE`] of the noise of phases
//! or Doppler changes no covariance by more than that and is left out: then the epoch is gathered in information form.
//!
//! Cost for n states: that of the linearisation and 4 n³/3 multiply-adds ([`information`]); with an Ω that counts, p n² for p
//! rows and p³/6. The sums of residuals take p n z for z coefficients in a row. All memory is the caller's scratch. Panics
//! where an epoch is asked for that is not there.

use super::super::model::{Density, Scratch, Sums};
use super::super::vector::vectorised;
use super::MultiBand;
use super::groups::{Group, GroupRows, VirtualRows};
use super::settings::{Record, dot_bands};
use surefix_core::filter::linearize::{LinearizeError, Rule, Work as LinearizeWork, linearize};
use surefix_core::filter::update::information::{self, Information};
use surefix_core::filter::update::{Form, Gauge, Rows, Stage, UpdateError, VECTORS, Work};
use surefix_core::linalg::{Mat, MatMut};
use surefix_core::model::multi_band::{Combination, Layout, MultiBandModel, Signal};
use surefix_core::model::partially_linear::Nonlinear;

/// Ω of less than this part of the noise is left out `[1]`.
const NEGLIGIBLE: f64 = 1e-10;

/// z.
const INPUTS: usize = Layout::Z.end;

/// Points of a rule whose values are kept: 2 d + 1.
const SAMPLES: usize = 2 * INPUTS + 1;

/// The nonlinear part about a density: values, ∂/∂z by rows, and Ω, for M ρ and −M ρ̇.
struct Linear<'a> {
    values: &'a mut Vec<f64>,
    slope: &'a mut Vec<f64>,
    omega: &'a mut Vec<f64>,
}

fn zeros(list: &mut Vec<f64>, n: usize) -> &mut [f64] {
    list.clear();
    list.resize(n, 0.0);
    list
}

/// A failure to linearise, as one of the update.
fn refused(error: LinearizeError) -> UpdateError {
    match error {
        LinearizeError::NotPositiveDefinite => UpdateError::NotPositiveDefinite { state: 0 },
        LinearizeError::NotFinite => UpdateError::NotFinite,
        LinearizeError::Shape | LinearizeError::Inputs | LinearizeError::Rule => UpdateError::Shape,
    }
}

impl Linear<'_> {
    /// Linearises about a density.
    fn about(
        &mut self,
        model: &MultiBandModel,
        rule: Rule,
        density: &Density,
        work: [&mut Vec<f64>; 3],
    ) -> Result<(), UpdateError> {
        let p = model.outputs();
        let covariance: [f64; INPUTS * INPUTS] = std::array::from_fn(|k| density.covariance(k / INPUTS, k % INPUTS));
        let [values, reference, samples] = work;
        linearize(
            rule,
            model,
            &density.mean[Layout::Z],
            Mat::square(&covariance, INPUTS)?,
            zeros(self.values, p),
            &mut MatMut::new(zeros(self.slope, p * INPUTS), p, INPUTS, INPUTS)?,
            &mut MatMut::square(zeros(self.omega, p * p), p)?,
            LinearizeWork {
                values: zeros(values, p),
                reference: zeros(reference, p),
                samples: zeros(samples, SAMPLES * p),
            },
        )
        .map_err(refused)
    }

    /// Whether Ω counts against noises of these variances.
    fn curved(&self, range: f64, rate: f64) -> bool {
        let p = self.values.len();
        let counts = |row: usize| {
            let noise = if row < p / 2 { range } else { rate };
            self.omega[row * p + row].abs() > NEGLIGIBLE * noise
        };
        (0..p).any(counts)
    }

    /// Ω of two rows.
    fn omega(&self, i: usize, j: usize) -> f64 {
        self.omega[i.max(j) * self.values.len() + i.min(j)]
    }
}

/// The phase of a band with its fixed ambiguities, NaN where they are free, taken off.
fn resolved_phase(model: &MultiBandModel, record: &Record, fixed: &[f64], band: usize, i: usize) -> f64 {
    let integer = fixed[band * record.differences() + i];
    let phase = record.signal(Signal::Phase, band, i);
    if integer.is_nan() { phase } else { phase - model.bands.wavelength(band) * integer }
}

impl MultiBand {
    /// A combination of what was measured of a signal, for a difference, without fixed ambiguities.
    fn measured(&self, k: usize, signal: Signal, combination: &Combination, i: usize) -> f64 {
        let record = &self.records[k];
        if signal == Signal::Phase {
            let model = self.at(k);
            dot_bands(combination, |band| resolved_phase(&model, record, &self.fixed[k], band, i))
        } else {
            record.combined(signal, combination, i)
        }
    }

    /// y − h(m) of a row of a group.
    fn innovation(&self, k: usize, group: &Group, i: usize, linear: &Linear, mean: &[f64]) -> f64 {
        let m = self.layout.differences();
        let nonlinear = group.geometry * linear.values[group.nonlinear_row(m) + i];
        let predicted = group.entries[i].iter().fold(nonlinear, |sum, &(state, coefficient)| {
            self.places[k].of(state).map_or(sum, |place| sum + coefficient * mean[place])
        });
        self.measured(k, group.signal, &group.combination, i) - predicted
    }

    /// The update with all measurements of an epoch.
    pub(super) fn take_measurements(
        &self,
        k: usize,
        density: &mut Density,
        scratch: &mut Scratch,
    ) -> Result<Gauge<f64>, UpdateError> {
        let (model, m, n) = (self.at(k), self.layout.differences(), density.dim());
        let groups = &self.groups(k).informative;
        let [values, slope, omega, rows, innovation, noise, correction, samples] = &mut scratch.buffers;
        let mut linear = Linear { values, slope, omega };
        linear.about(&model, self.settings.rule, density, [rows, innovation, samples])?;
        let curved = linear.curved(model.signal_variance(Signal::Phase), model.signal_variance(Signal::Doppler));
        innovation.clear();
        for group in groups {
            innovation.extend((0..m).map(|i| self.innovation(k, group, i, &linear, &density.mean)));
        }
        let signals = GroupRows { groups, differences: m, slope: linear.slope, places: &self.places[k] };
        let biases = VirtualRows { states: &self.virtual_states, places: &self.places[k] };
        let mean = &density.mean;
        let predicted = |row: usize| self.places[k].of(self.virtual_states[row]).map_or(0.0, |place| mean[place]);
        let bias_innovation = |row: usize| self.records[k].virtual_rows[row] - predicted(row);
        let bias_variance = |row: usize| model.virtual_row(row).map_or(f64::NAN, |(_, variance)| variance);
        let bias_rows = 0..self.virtual_states.len();
        let correction = zeros(correction, n);
        let mut covariance = MatMut::square(&mut density.covariance, n)?;
        let mut gauge = if curved {
            let at_once = groups.len() * m;
            let (row_buffer, vectors) = zeros(rows, (at_once + VECTORS) * n).split_at_mut(at_once * n);
            let work =
                Work { rows: MatMut::new(row_buffer, at_once, n, n)?, vectors: MatMut::new(vectors, VECTORS, n, n)? };
            let mut stage = Stage::begin(Form::Sequential, correction, covariance, work)?;
            let entries = zeros(noise, at_once * at_once);
            for (row, entries) in entries.chunks_mut(at_once).enumerate() {
                let (group, i) = (&groups[row / m], row % m);
                entries[row / m * m..=row].fill(model.signal_variance(group.signal));
                entries[row] *= 2.0;
                for (column, entry) in entries[..=row].iter_mut().enumerate() {
                    let (other, j) = (&groups[column / m], column % m);
                    let at = |group: &Group, i: usize| group.nonlinear_row(m) + i;
                    *entry += group.geometry * other.geometry * linear.omega(at(group, i), at(other, j));
                }
            }
            stage.correlated(&signals, 0, innovation, &mut MatMut::square(entries, at_once)?)?;
            stage.independent(&biases, bias_rows, bias_innovation, bias_variance)?;
            stage.finish()?
        } else {
            rows.resize(rows.len().max(information::buffer_len(n)), 0.0);
            vectorised(
                #[inline(always)]
                || {
                    let mut information = Information::new(rows, n)?;
                    for (g, group) in groups.iter().enumerate() {
                        let variance = model.signal_variance(group.signal);
                        information.differences(&signals, g * m..(g + 1) * m, |row| innovation[row], variance)?;
                    }
                    information.independent(&biases, bias_rows, bias_innovation, bias_variance)?;
                    information.update(correction, &mut covariance)
                },
            )?
        };
        for (mean, correction) in density.mean.iter_mut().zip(correction) {
            *mean += *correction;
        }
        gauge.add(self.gauge_of_noise(k, &model));
        Ok(gauge)
    }

    /// The part of the likelihood that no state can change: combinations that are noise alone, and what the paper's
    /// combinations of bands add to ln det S.
    fn gauge_of_noise(&self, k: usize, model: &MultiBandModel) -> Gauge<f64> {
        let m = self.layout.differences();
        let jacobian = 2.0 * (Signal::ALL.len() * m) as f64 * model.bands.ionosphere_free_log_determinant();
        let mut gauge = Gauge { rows: 0, normalized_innovation_squared: 0.0, log_determinant: jacobian };
        for (signal, combination) in &self.groups(k).noise {
            let variance = model.signal_variance(*signal);
            let squared = difference_form((0..m).map(|i| self.measured(k, *signal, combination, i)));
            gauge.add(Gauge {
                rows: m,
                normalized_innovation_squared: squared / variance,
                log_determinant: m as f64 * variance.ln() + log_determinant_of_differences(m),
            });
        }
        gauge
    }

    /// Adds what the residuals of an epoch say of each noise.
    pub(super) fn sum_residuals(&self, k: usize, smoothed: &Density, scratch: &mut Scratch, sums: &mut Sums) {
        let (model, m, n) = (self.at(k), self.layout.differences(), smoothed.dim());
        let (first, groups) = (self.noise_parameter(), self.groups(k));
        let [values, slope, omega, rows, reference, samples, ..] = &mut scratch.buffers;
        let mut linear = Linear { values, slope, omega };
        // Without the numbers to linearise about there is nothing to learn.
        if linear.about(&model, Rule::Taylor, smoothed, [rows, reference, samples]).is_err() {
            return;
        }
        let factor = if self.settings.base.is_some() { 2.0 } else { 1.0 };
        let mut add = |signal: Signal, quadratic: f64| {
            sums.add(first + signal as usize, quadratic / factor, m as f64);
            let log_determinant = m as f64 * f64::ln(factor) + log_determinant_of_differences(m);
            sums.add_log_determinant(first + signal as usize, log_determinant);
        };
        for group in &groups.informative {
            let residuals = (0..m).map(|i| self.innovation(k, group, i, &linear, &smoothed.mean));
            let squared = difference_form(residuals);
            let one = std::slice::from_ref(group);
            let group_rows = GroupRows { groups: one, differences: m, slope: linear.slope, places: &self.places[k] };
            let dense = zeros(rows, m * n);
            for (row, dense) in dense.chunks_mut(n).enumerate() {
                group_rows.for_each(row, &mut |state, coefficient| dense[state] += coefficient);
            }
            add(group.signal, squared + covariance_form(smoothed, dense, n));
        }
        for (signal, combination) in &groups.noise {
            let squared = difference_form((0..m).map(|i| self.measured(k, *signal, combination, i)));
            add(*signal, squared);
        }
        let jacobian = 2.0 * m as f64 * model.bands.ionosphere_free_log_determinant();
        for signal in Signal::ALL {
            sums.add_log_determinant(first + signal as usize, jacobian);
        }
        for (row, (&state, measured)) in self.virtual_states.iter().zip(&self.records[k].virtual_rows).enumerate() {
            if let Some(place) = self.places[k].of(state) {
                let residual = measured - smoothed.mean[place];
                let kind = row / self.layout.satellites;
                let quadratic = residual * residual + smoothed.covariance(place, place);
                sums.add(first + Signal::ALL.len() + kind, quadratic, 1.0);
            }
        }
    }
}

/// ln det M Mᵀ for m differences: M Mᵀ = I + 11ᵀ.
fn log_determinant_of_differences(m: usize) -> f64 {
    (m as f64 + 1.0).ln()
}

/// vᵀ (M Mᵀ)⁻¹ v, with (M Mᵀ)⁻¹ = I − 11ᵀ/(m + 1).
fn difference_form(values: impl Iterator<Item = f64>) -> f64 {
    let add = |(squares, sum, m), value| (squares + value * value, sum + value, m + 1.0);
    let (squares, sum, m) = values.fold((0.0, 0.0, 0.0), add);
    squares - sum * sum / (m + 1.0)
}

/// tr((M Mᵀ)⁻¹ H P Hᵀ) for the rows of H (n states each).
fn covariance_form(density: &Density, rows: &[f64], n: usize) -> f64 {
    let quadratic = |h: &[f64]| -> f64 {
        let row = |i: usize| {
            let p = &density.covariance[i * n..=i * n + i];
            let below: f64 = p[..i].iter().zip(h).map(|(p, h)| p * h).sum();
            h[i] * (2.0 * below + h[i] * p[i])
        };
        (0..n).filter(|&i| h[i] != 0.0).map(row).sum()
    };
    let sum: Vec<f64> = (0..n).map(|i| rows.iter().skip(i).step_by(n).sum()).collect();
    let m = rows.len() as f64 / n as f64;
    rows.chunks(n).map(quadratic).sum::<f64>() - quadratic(&sum) / (m + 1.0)
}
