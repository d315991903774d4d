//! Statistics of errors, and of errors over their own standard deviations.

use super::Sample;
use nalgebra::{Cholesky, Vector3};
use serde::Serialize;
use surefix_core::gnss::time::GpsTime;

/// Three components in the local frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Enu {
    /// East.
    pub east: f64,
    /// North.
    pub north: f64,
    /// Up.
    pub up: f64,
}

impl From<Vector3<f64>> for Enu {
    fn from(v: Vector3<f64>) -> Self {
        Self { east: v.x, north: v.y, up: v.z }
    }
}

/// Order statistics: the value at rank ⌈p·n⌉.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Percentiles {
    /// Half of the sample is not larger.
    pub p50: f64,
    /// 95 % of the sample are not larger.
    pub p95: f64,
    /// Largest.
    pub max: f64,
}

impl Percentiles {
    fn of(values: impl Iterator<Item = f64>) -> Self {
        let mut sorted: Vec<f64> = values.collect();
        sorted.sort_by(f64::total_cmp);
        let at = |p: f64| {
            let rank = (p * sorted.len() as f64).ceil() as usize;
            sorted.get(rank.saturating_sub(1)).copied().unwrap_or(f64::NAN)
        };
        Self { p50: at(0.5), p95: at(0.95), max: at(1.0) }
    }
}

/// Errors of a set of epochs `[m]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Errors {
    /// Epochs.
    pub count: usize,
    /// Mean.
    pub mean_m: Enu,
    /// Standard deviation about the mean (divisor n, so that rms² = mean² + sd²).
    pub sd_m: Enu,
    /// Root mean square, east and north together.
    pub rms_horizontal_m: f64,
    /// Root mean square, up.
    pub rms_vertical_m: f64,
    /// Root mean square, all three together.
    pub rms_3d_m: f64,
    /// Length of the horizontal error.
    pub horizontal_m: Percentiles,
    /// Size of the vertical error.
    pub vertical_m: Percentiles,
    /// Length of the error.
    pub three_d_m: Percentiles,
}

impl Errors {
    /// Of a set of epochs; `None` if it is empty.
    pub(crate) fn of(samples: &[Sample]) -> Option<Self> {
        let n = samples.len() as f64;
        if samples.is_empty() {
            return None;
        }
        let mean = samples.iter().map(|sample| sample.error).sum::<Vector3<f64>>() / n;
        let mean_square = |center: Vector3<f64>| {
            let square = |sample: &Sample| (sample.error - center).map(|component| component * component);
            samples.iter().map(square).sum::<Vector3<f64>>() / n
        };
        let square = mean_square(Vector3::zeros());
        let errors = || samples.iter().map(|sample| sample.error);
        Some(Self {
            count: samples.len(),
            mean_m: mean.into(),
            sd_m: mean_square(mean).map(f64::sqrt).into(),
            rms_horizontal_m: (square.x + square.y).sqrt(),
            rms_vertical_m: square.z.sqrt(),
            rms_3d_m: square.sum().sqrt(),
            horizontal_m: Percentiles::of(errors().map(|error| error.xy().norm())),
            vertical_m: Percentiles::of(errors().map(|error| error.z.abs())),
            three_d_m: Percentiles::of(errors().map(|error| error.norm())),
        })
    }
}

/// Errors over their own standard deviations: 1 where these tell the truth, larger where they promise too much.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Normalized {
    /// Epochs with a covariance.
    pub count: usize,
    /// Root mean square of error over standard deviation.
    pub rms: Enu,
    /// Mean of the normalised error squared eᵀ Σ⁻¹ e (NEES); 3 is expected.
    pub nees_mean: f64,
    /// Epochs in that mean: those whose covariance has an inverse (four printed digits may spoil it).
    pub nees_count: usize,
    /// Largest error of a component over its standard deviation.
    pub worst: f64,
    /// Where that is, as week and seconds of week.
    pub worst_at: (i32, f64),
    /// Epochs with a component beyond ten standard deviations.
    pub beyond_10_sigma: usize,
}

impl Normalized {
    /// Of the epochs that have a covariance with a positive diagonal; `None` if there is none.
    pub(crate) fn of(samples: &[Sample]) -> Option<Self> {
        let mut count = 0_usize;
        let mut squares = Vector3::zeros();
        let (mut nees, mut nees_count) = (0.0, 0_usize);
        let (mut worst, mut worst_at) = (0.0, GpsTime::default());
        let mut beyond_10_sigma = 0;
        for sample in samples {
            let Some(covariance) = sample.covariance else { continue };
            let variances = covariance.diagonal();
            if variances.min() <= 0.0 || variances.iter().any(|variance| !variance.is_finite()) {
                continue;
            }
            let normalized = sample.error.component_div(&variances.map(f64::sqrt));
            count += 1;
            squares += normalized.component_mul(&normalized);
            let largest = normalized.amax();
            beyond_10_sigma += usize::from(largest > 10.0);
            if largest >= worst {
                (worst, worst_at) = (largest, sample.time);
            }
            if let Some(factor) = Cholesky::new(covariance) {
                nees += sample.error.dot(&factor.solve(&sample.error));
                nees_count += 1;
            }
        }
        (count > 0).then(|| Self {
            count,
            rms: (squares / count as f64).map(f64::sqrt).into(),
            nees_mean: if nees_count > 0 { nees / nees_count as f64 } else { 0.0 },
            nees_count,
            worst,
            worst_at: (worst_at.week(), worst_at.tow()),
            beyond_10_sigma,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;
    use surefix_core::gnss::solution::Quality;

    fn sample(error: [f64; 3], covariance: Option<Matrix3<f64>>) -> Sample {
        Sample {
            time: GpsTime::from_week_tow(2000, 5.0),
            quality: Quality::Fixed,
            error: error.into(),
            covariance,
            protection: None,
        }
    }

    #[test]
    fn percentiles_are_ranks() {
        let percentiles = Percentiles::of((1..=20).rev().map(f64::from));
        assert_eq!(percentiles, Percentiles { p50: 10.0, p95: 19.0, max: 20.0 });
        assert_eq!(Percentiles::of([7.0].into_iter()), Percentiles { p50: 7.0, p95: 7.0, max: 7.0 });
    }

    #[test]
    fn errors_by_hand() {
        let errors = Errors::of(&[sample([3.0, 4.0, 0.0], None), sample([1.0, 0.0, 2.0], None)]).unwrap();
        assert_eq!(errors.mean_m, Enu { east: 2.0, north: 2.0, up: 1.0 });
        assert_eq!(errors.sd_m, Enu { east: 1.0, north: 2.0, up: 1.0 });
        assert_eq!(errors.rms_horizontal_m, 13.0_f64.sqrt()); // (25 + 1) / 2
        assert_eq!((errors.rms_vertical_m, errors.rms_3d_m), (2.0_f64.sqrt(), 15.0_f64.sqrt()));
        assert_eq!(errors.horizontal_m, Percentiles { p50: 1.0, p95: 5.0, max: 5.0 });
        assert!(Errors::of(&[]).is_none());
    }

    #[test]
    fn nees_uses_the_whole_covariance() {
        // Σ = [[2 1][1 2]] ⊕ 1, e = (1 −1 0): Σ⁻¹ e = (1 −1 0), so NEES 2; components over σ: 1/√2.
        let covariance = Matrix3::new(2.0, 1.0, 0.0, 1.0, 2.0, 0.0, 0.0, 0.0, 1.0);
        let normalized = Normalized::of(&[sample([1.0, -1.0, 0.0], Some(covariance))]).unwrap();
        assert!((normalized.nees_mean - 2.0).abs() < 1e-12 && (normalized.worst - 0.5_f64.sqrt()).abs() < 1e-12);
        assert_eq!((normalized.count, normalized.worst_at), (1, (2000, 5.0)));
    }

    #[test]
    fn covariances_that_are_none_are_left_out() {
        let singular = Matrix3::from_element(1.0);
        let negative = Matrix3::from_diagonal(&Vector3::new(-1.0, 1.0, 1.0));
        let samples = [sample([1.0; 3], Some(singular)), sample([1.0; 3], Some(negative)), sample([1.0; 3], None)];
        let normalized = Normalized::of(&samples).unwrap();
        assert_eq!((normalized.count, normalized.nees_count), (1, 0));
        assert!(Normalized::of(&samples[1..]).is_none());
    }
}
