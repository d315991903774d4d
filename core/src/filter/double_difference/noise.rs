//! R₀, what was learned of it, and R* as a whole matrix.
//!
//! ```text
//! (R₀)ᵢⱼ = 2 (σᵢ² δᵢⱼ + σ_r²)     for double differences of one type; none between types         (9)
//! ratios     R* = D^½ R₀ D^½, D from residuals, for each type or channel; also the gate
//! whole      R* ← (1 − β) R* + β E, generalised eigenvalues by R₀ clipped                        (25), guarded
//! ```
//! Codes are used with κ times their variance, as their noise is correlated in time ([`overbound`](super::Options::overbound)). What is learned
//! of them is the noise without κ: ratios of (ε² + h P⁺ hᵀ/κ)/(R₀/κ), the spread being that of a filter that overbounds.
//!
//! Gate: a double difference whose normalised innovation exceeds it has its variance raised until it does not (P. J. Huber's
//! weights, on innovations), so that R* stays positive definite whatever is gated.

use super::super::adaptive::forgetting::{Beta, Forgetting};
use super::super::adaptive::matrix::{self, Form};
use super::super::adaptive::ratio;
use super::super::update::{Rows, project};
use super::{Adaptation, BANDS, DoubleDifferenceError, DoubleDifferenceFilter, Geometry, TYPES};
use crate::linalg::{LinalgError, Mat, MatMut, cholesky, head, head_mut};
use crate::real::Real;

/// What residuals said so far.
#[derive(Debug)]
pub(super) struct Learned<T, const M: usize> {
    /// Ratios of P1, P2, L1, L2.
    pub types: [T; TYPES],
    /// Ratio of each double difference, in the order of measurements.
    pub channels: [T; M],
    /// Whether something was learned, and β of that.
    pub beta: Option<f64>,
    /// νᵀ S⁻¹ ν of the latest update, and its number of rows.
    pub gauge: (f64, usize),
}

impl<T: Real, const M: usize> Learned<T, M> {
    pub const fn new() -> Self {
        Self { types: [T::ONE; TYPES], channels: [T::ONE; M], beta: None, gauge: (0.0, 0) }
    }

    /// Ratio of a row.
    fn ratio(&self, adaptation: Adaptation, row: usize, satellites: usize) -> T {
        let ratio = match adaptation {
            Adaptation::Type => row.checked_div(satellites).and_then(|kind| self.types.get(kind)),
            Adaptation::Channel => self.channels.get(row),
            _ => None,
        };
        ratio.copied().unwrap_or(T::ONE)
    }
}

/// R* as a whole matrix for up to M measurements, and the memory to work on it: 6 M² scalars.
///
/// Where satellites come or go, what is learned goes on from R* as remapped, with restarted rows and perhaps indefinite;
/// what an update uses is floored.
#[derive(Debug)]
pub struct WholeNoise<T, const M: usize> {
    pub(super) r: [[T; M]; M],
    used: [[T; M]; M],
    pub(super) rows: usize,
    pub(super) spread: [[T; M]; M],
    factor: [[T; M]; M],
    square: [[T; M]; M],
    vectors: [[T; M]; M],
    values: [T; M],
}

impl<T: Real, const M: usize> Default for WholeNoise<T, M> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real, const M: usize> WholeNoise<T, M> {
    /// Nothing learned.
    pub const fn new() -> Self {
        let zero = [[T::ZERO; M]; M];
        Self {
            r: zero,
            used: zero,
            rows: 0,
            spread: zero,
            factor: zero,
            square: zero,
            vectors: zero,
            values: [T::ZERO; M],
        }
    }

    /// Begins anew from R₀ in the next epoch.
    pub(super) fn forget(&mut self) {
        self.rows = 0;
    }

    /// R* as updates use it.
    pub fn matrix(&self) -> Mat<'_, T> {
        Mat::new(self.used.as_flattened(), self.rows, self.rows, M).unwrap_or(Mat::empty())
    }

    /// Makes what is used of what is learned: generalised eigenvalues by R₀ are clipped.
    pub(super) fn floor(&mut self, r0: Mat<'_, T>, bounds: Option<[f64; 2]>) -> Result<(), LinalgError> {
        let m = self.rows;
        let learned = Mat::new(self.r.as_flattened(), m, m, M)?;
        let mut r = MatMut::new(self.used.as_flattened_mut(), m, m, M)?;
        r.copy_from(learned)?;
        let Some(bounds) = bounds else { return Ok(()) };
        let mut work = matrix::FloorWork {
            factor: MatMut::new(self.factor.as_flattened_mut(), m, m, M)?,
            square: MatMut::new(self.square.as_flattened_mut(), m, m, M)?,
            vectors: MatMut::new(self.vectors.as_flattened_mut(), m, m, M)?,
            values: head_mut(&mut self.values, m),
        };
        matrix::floor(&mut r, r0, bounds.map(T::from_f64), &mut work)
    }
}

/// (R₀)ᵢⱼ for the rows of measurements, from variances of the reference (first) and the others.
pub(super) fn r0_entry<T: Real>(variances: &[[T; 2]], s: usize, i: usize, j: usize) -> T {
    if s == 0 || i / s != j / s {
        return T::ZERO;
    }
    let of = |satellite: usize| -> T {
        let [code, phase] = variances.get(satellite).copied().unwrap_or([T::ONE; 2]);
        if i / s < BANDS { code } else { phase }
    };
    let both = if i == j { of(0) + of(1 + i % s) } else { of(0) };
    both + both
}

/// Fills a matrix with R₀.
pub(super) fn fill_r0<T: Real>(to: &mut MatMut<'_, T>, variances: &[[T; 2]], s: usize) {
    for (i, row) in to.iter_mut().enumerate() {
        for (j, entry) in row.iter_mut().enumerate() {
            *entry = r0_entry(variances, s, i, j);
        }
    }
}

/// h P hᵀ of a row, from the lower triangle of P.
fn spread_of<T: Real>(p: Mat<'_, T>, rows: &impl Rows<T>, row: usize) -> T {
    let (mut entries, mut count) = ([(0, T::ZERO); 4], 0);
    rows.for_each(row, &mut |state, h| {
        if let Some(entry) = entries.get_mut(count) {
            *entry = (state, h);
        }
        count += 1;
    });
    let entries = head(&entries, count.min(4));
    entries
        .iter()
        .fold(T::ZERO, |sum, &(i, a)| entries.iter().fold(sum, |sum, &(j, b)| sum + a * b * p.at(i.max(j), i.min(j))))
}

impl<T: Real, const A: usize, const N: usize, const M: usize> DoubleDifferenceFilter<T, A, N, M> {
    /// The noise of the coming update into `noise`: R* by what was learned, raised where the gate says so.
    pub(super) fn fill_noise(&mut self, whole: Option<&WholeNoise<T, M>>) -> Result<(), DoubleDifferenceError> {
        let (n, m, s) = (self.states(), self.measurements(), self.satellites.len());
        let Self { noise, variances, learned, options, density, directions, innovation, residual, .. } = self;
        let mut noise = MatMut::new(noise.as_flattened_mut(), m, m, M)?;
        match whole
            .filter(|whole| whole.rows == m && matches!(options.adaptation, Adaptation::Residual | Adaptation::Literal))
        {
            Some(whole) => noise.copy_from(whole.matrix())?,
            None => fill_r0(&mut noise, variances, s),
        }
        let geometry = Geometry { directions: head(directions, s), wavelengths: options.wavelengths.map(T::from_f64) };
        let p = density.view(n).1;
        // Roots of the ratios, in the place of the residuals.
        let roots = head_mut(residual, m);
        self.gated = 0;
        let mut any = false;
        for (i, (root, &innovation)) in roots.iter_mut().zip(&*innovation).enumerate() {
            let mut ratio = learned.ratio(options.adaptation, i, s);
            if options.gate.is_finite() {
                let (own, spread) = (ratio * noise.at(i, i), spread_of(p, &geometry, i));
                let gate = T::from_f64(options.gate);
                let wanted = innovation * innovation / (gate * gate) - spread;
                if wanted > own && wanted.is_finite() {
                    ratio *= wanted / own;
                    self.gated += 1;
                }
            }
            any |= ratio != T::ONE;
            *root = ratio.sqrt();
        }
        if any {
            ratio::rescale(&mut noise, roots);
        }
        Ok(())
    }

    /// H P Hᵀ of the density as it is now, into `whole`.
    fn spread(&mut self, whole: &mut WholeNoise<T, M>) -> Result<(), DoubleDifferenceError> {
        let (n, m, s) = (self.states(), self.measurements(), self.satellites.len());
        let wavelengths = self.options.wavelengths.map(T::from_f64);
        let geometry = Geometry { directions: head(&self.directions, s), wavelengths };
        let mut rows = MatMut::new(self.rows.as_flattened_mut(), m, n, N)?;
        let mut spread = MatMut::new(whole.spread.as_flattened_mut(), m, m, M)?;
        spread.fill(T::ZERO);
        project(self.density.view(n).1, &geometry, 0, &mut rows, &mut spread, |_, _, _| ());
        spread.mirror_lower();
        Ok(())
    }

    /// H P⁻ Hᵀ, which the literal form wants.
    pub(super) fn prior_spread(&mut self, whole: &mut WholeNoise<T, M>) -> Result<(), DoubleDifferenceError> {
        if self.options.adaptation == Adaptation::Literal { self.spread(whole) } else { Ok(()) }
    }

    /// β of this epoch.
    fn next_beta(&mut self) -> f64 {
        let forgetting = self.options.forgetting;
        let first = self.learned.beta.is_none() && matches!(forgetting, Forgetting::SageHusa { .. });
        let beta = if first { self.beta.get() } else { Beta::next(&mut self.beta, &forgetting, self.success) };
        self.learned.beta = Some(beta);
        beta
    }

    /// Learns from the update that was just made; the density is still that of its posterior, in its lower triangle.
    pub(super) fn learn(&mut self, whole: Option<&mut WholeNoise<T, M>>) -> Result<(), DoubleDifferenceError> {
        let beta = T::from_f64(self.next_beta());
        let (n, m, s) = (self.states(), self.measurements(), self.satellites.len());
        let Self { options, directions, density, innovation, residual, .. } = self;
        let overbound = T::from_f64(options.overbound).sqrt();
        let wavelengths = options.wavelengths.map(T::from_f64);
        let geometry = Geometry { directions: head(directions, s), wavelengths };
        for (row, (residual, &innovation)) in residual.iter_mut().zip(&*innovation).enumerate().take(m) {
            *residual = innovation;
            let correction = density.correction();
            geometry.for_each(row, &mut |state, h| {
                *residual += -(h * correction.get(state).copied().unwrap_or(T::ZERO));
            });
            // R₀ of codes is the overbounding one: their squares are to be as much larger.
            if row < BANDS * s {
                *residual *= overbound;
            }
        }
        let bounds = options.bounds.map(|bounds| bounds.map(T::from_f64));
        match options.adaptation {
            Adaptation::Off => Ok(()),
            Adaptation::Type => self.learn_types(beta, bounds),
            Adaptation::Channel => {
                let Self { options, density, directions, variances, learned, residual, .. } = self;
                let wavelengths = options.wavelengths.map(T::from_f64);
                let geometry = Geometry { directions: head(directions, s), wavelengths };
                let p = density.view(n).1;
                for (i, (ratio, &residual)) in head_mut(&mut learned.channels, m).iter_mut().zip(&*residual).enumerate()
                {
                    let sample = (residual * residual + spread_of(p, &geometry, i)) / r0_entry(variances, s, i, i);
                    *ratio = ratio::blend(*ratio, beta, sample, bounds.unwrap_or([T::ZERO, T::from_f64(1e30)]));
                }
                Ok(())
            }
            form @ (Adaptation::Residual | Adaptation::Literal) => {
                let Some(whole) = whole else { return Err(DoubleDifferenceError::NoWholeNoise) };
                let (form, source) = if form == Adaptation::Residual {
                    self.spread(whole)?;
                    (Form::Residual, &self.residual)
                } else {
                    (Form::Innovation, &self.innovation)
                };
                let mut r = MatMut::new(whole.r.as_flattened_mut(), m, m, M)?;
                let spread = Mat::new(whole.spread.as_flattened(), m, m, M)?;
                matrix::blend(&mut r, beta, head(source, m), spread, form)?;
                let mut r0 = MatMut::new(self.noise.as_flattened_mut(), m, m, M)?;
                fill_r0(&mut r0, &self.variances, s);
                whole.floor(r0.as_ref(), self.options.bounds)?;
                whole.r = whole.used;
                Ok(())
            }
        }
    }

    /// A ratio for each type: tr(R₀⁻¹ E)/s over its block.
    fn learn_types(&mut self, beta: T, bounds: Option<[T; 2]>) -> Result<(), DoubleDifferenceError> {
        let (n, s) = (self.states(), self.satellites.len());
        let Self { options, density, directions, variances, learned, residual, noise, rows, .. } = self;
        let geometry = Geometry { directions: head(directions, s), wavelengths: options.wavelengths.map(T::from_f64) };
        let Some((first, second)) = noise.as_flattened_mut().split_at_mut_checked(s * M) else {
            return Err(DoubleDifferenceError::Capacity);
        };
        for (kind, (ratio, residual)) in learned.types.iter_mut().zip(residual.chunks_exact_mut(s.max(1))).enumerate() {
            let mut factor = MatMut::new(first, s, s, M)?;
            for (i, row) in factor.iter_mut().enumerate() {
                for (j, entry) in row.iter_mut().enumerate() {
                    *entry = r0_entry(variances, s, kind * s + i, kind * s + j);
                }
            }
            cholesky::factor(&mut factor)?;
            let mut spread = MatMut::new(second, s, s, M)?;
            spread.fill(T::ZERO);
            let mut work = MatMut::new(rows.as_flattened_mut(), s, n, N)?;
            project(density.view(n).1, &geometry, kind * s, &mut work, &mut spread, |_, _, _| ());
            spread.mirror_lower();
            let sample = ratio::mean_ratio(factor.as_ref(), residual, &mut spread)?;
            *ratio = ratio::blend(*ratio, beta, sample, bounds.unwrap_or([T::ZERO, T::from_f64(1e30)]));
        }
        Ok(())
    }

    /// Variance of a measurement in R* as the coming update uses it, without what the gate may add: that of R₀ where nothing
    /// was learned. `whole` is for the forms that have it.
    pub fn noise_variance(&self, row: usize, whole: Option<&WholeNoise<T, M>>) -> f64 {
        let s = self.satellites.len();
        if let Some(whole) = whole {
            return whole.matrix().at(row, row).to_f64();
        }
        let ratio = self.learned.ratio(self.options.adaptation, row, s);
        (ratio * r0_entry(&self.variances, s, row, row)).to_f64()
    }

    /// Whether R₀ or R* of the coming epoch is positive definite: by construction for ratios, by trial for whole matrices.
    pub fn noise_is_positive_definite(&mut self, whole: Option<&WholeNoise<T, M>>) -> bool {
        let m = self.measurements();
        let Ok(mut factor) = MatMut::new(self.noise.as_flattened_mut(), m, m, M) else { return false };
        match whole {
            Some(whole) => matrix::check(whole.matrix(), &mut factor).is_ok(),
            None => {
                let ratio = |row| self.learned.ratio(self.options.adaptation, row, self.satellites.len());
                let own = (0..m).all(|row| ratio(row) > T::ZERO && ratio(row).is_finite());
                fill_r0(&mut factor, &self.variances, self.satellites.len());
                own && cholesky::factor(&mut factor).is_ok()
            }
        }
    }
}
