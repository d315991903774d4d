//! Fig. 4: bounds and approximations of success rates against a factor F on the covariance of the ambiguities, with what a
//! simulation of integer least squares comes to.
//!
//! Q is that of the float ambiguities after one epoch of twelve satellites, 0.3 m and 1 cm, as the paper's. Table 1 of the
//! paper, corrected: the product over conditional σ is the rate of bootstrapping, a lower bound of integer least squares;
//! (2Φ(1/(2 ADOP)) − 1)ⁿ bounds bootstrapping from above and is for integer least squares an approximation.

use super::scenario::{satellites, sin_elevation};
use crate::ambiguity::monte_carlo::MonteCarlo;
use nalgebra::Vector3;
use surefix_core::filter::double_difference::{DoubleDifference22, Options, Sight};
use surefix_core::integer::decorrelate::decorrelate;
use surefix_core::integer::success_rate as rate;
use surefix_core::integer::{Config, Workspace, resolve};
use surefix_core::linalg::{Mat, MatMut, eigen};

/// Names of the columns.
pub const COLUMNS: [&str; 12] = [
    "F",
    "ils_simulated",
    "ib_simulated",
    "ir_simulated",
    "bootstrapped",
    "adop_approximation",
    "ils_upper_adop",
    "ils_upper_slabs",
    "ils_lower_ball",
    "ir_lower",
    "ils_lower_eigenvalue",
    "ils_upper_eigenvalue",
];

/// Factors, from 0.1 to 10 in steps of a tenth of a decade.
const FACTORS: std::ops::RangeInclusive<i32> = -10..=10;
/// Samples for each factor: standard error below 0.4 %.
const SAMPLES: u64 = 20_000;
/// Room for the ambiguities of them on two bands.
const CAPACITY: usize = 22;
/// Satellites, the reference included.
const SATELLITES: usize = 12;

/// Rows of Fig. 4.
#[derive(Clone, Debug, PartialEq)]
pub struct Bounds {
    /// Number of ambiguities.
    pub ambiguities: usize,
    /// For each factor, the columns.
    pub rows: Vec<[f64; 12]>,
}

/// Covariance of the float ambiguities of one epoch `[cycles²]`.
fn covariance() -> Option<(usize, Vec<f64>)> {
    // A second of the day with enough satellites.
    let all = (0..24).map(|hour| satellites(3600.0 * f64::from(hour)));
    let mut sky = all.max_by_key(|sky| sky.iter().filter(|s| sin_elevation(s) > 0.17).count())?;
    sky.sort_by(|a, b| sin_elevation(b).total_cmp(&sin_elevation(a)));
    let sight = |(id, s): (usize, &Vector3<f64>)| Sight {
        id: id as u8,
        position: *s,
        sin_elevation: sin_elevation(s),
        code: [0.0; 2],
        phase: [0.0; 2],
        new_lock: true,
    };
    let sights: Vec<Sight> = sky.iter().take(SATELLITES).enumerate().map(sight).collect();
    let mut filter = Box::new(DoubleDifference22::<f64>::new(Options { new_ambiguity: 1e6, ..Options::PAPER }));
    filter.start(&[0.0; 6], &[1e4, 1e4, 1e4, 1.0, 1.0, 1.0]).ok()?;
    filter.step(1.0, &sights, None).ok()?;
    let n = 2 * (sights.len() - 1);
    let p = filter.covariance();
    Some((n, (0..n * n).map(|k| p.get(6 + k / n, 6 + k % n).unwrap_or(0.0)).collect()))
}

impl Bounds {
    /// Computes and simulates; `None` if the covariance cannot be decorrelated.
    pub fn run(seed: u64) -> Option<Self> {
        let (n, q) = covariance()?;
        let rows = FACTORS.map(|tenth| Self::row(n, &q, 10f64.powf(f64::from(tenth) / 10.0), seed));
        Some(Self { ambiguities: n, rows: rows.collect::<Option<_>>()? })
    }

    fn row(n: usize, q: &[f64], factor: f64, seed: u64) -> Option<[f64; 12]> {
        let scaled: Vec<f64> = q.iter().map(|q| factor * q).collect();
        let view = Mat::square(&scaled, n).ok()?;
        let simulated = MonteCarlo { samples: SAMPLES, seed, ..MonteCarlo::default() }.run(view).ok()?;
        let mut workspace = Box::new(Workspace::<f64, CAPACITY>::new());
        // The shortest vector is the one second nearest to zero.
        let resolution = resolve(&vec![0.0; n], view, &Config::DEFAULT, &mut workspace).ok()?;
        let (variances, shortest) = (resolution.variances.to_vec(), resolution.second_norm);
        let (mut spoilt, mut eigenvalues) = (scaled.clone(), vec![0.0; n]);
        eigen::eigenvalues(&mut MatMut::square(&mut spoilt, n).ok()?, &mut eigenvalues).ok()?;
        let largest = eigenvalues.iter().copied().fold(0.0, f64::max);
        let least = eigenvalues.iter().copied().fold(f64::INFINITY, f64::min);
        let adop = rate::adop(&variances);
        Some([
            factor,
            simulated.rate(simulated.least_squares),
            simulated.rate(simulated.bootstrapping),
            simulated.rate(simulated.rounding),
            rate::bootstrapped(&variances).success,
            rate::adop_upper(adop, n).success,
            rate::ils_upper(adop, n).success,
            slabs(n, &scaled)?,
            rate::ball_lower(shortest, n).success,
            rate::rounding_lower(view).success,
            rate::eigenvalue_lower(largest, n).success,
            rate::eigenvalue_upper(least, n).success,
        ])
    }
}

/// The upper bound by slabs, along the unit vectors of the decorrelated ambiguities.
fn slabs(n: usize, q: &[f64]) -> Option<f64> {
    let (mut factor, mut variances) = (q.to_vec(), vec![0.0; n]);
    let [mut transform, mut inverse] = [(); 2].map(|()| vec![0; n * n]);
    decorrelate(
        &mut MatMut::square(&mut factor, n).ok()?,
        &mut variances,
        &mut MatMut::square(&mut transform, n).ok()?,
        &mut MatMut::square(&mut inverse, n).ok()?,
    )
    .ok()?;
    // A unit vector of z = Zᵀ a is a row of Z⁻¹ among the a.
    let [mut square, mut gram] = [(); 2].map(|()| vec![0.0; n * n]);
    let (mut rows, mut conditional) = (vec![0.0; n * n], vec![0.0; n]);
    let bound = rate::slab_upper(
        Mat::square(q, n).ok()?,
        Mat::square(&inverse, n).ok()?,
        &mut MatMut::square(&mut square, n).ok()?,
        &mut MatMut::square(&mut rows, n).ok()?,
        &mut MatMut::square(&mut gram, n).ok()?,
        &mut conditional,
    );
    bound.ok().map(|bound| bound.success)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bounds are bounds, within five standard errors (0.0035 at most) of the simulation.
    #[test]
    fn bounds_hold() {
        let bounds = Bounds::run(1).unwrap();
        assert_eq!((bounds.ambiguities, bounds.rows.len()), (22, 21));
        for [_, ils, ib, ir, bootstrapped, adop, upper, slabs, ball, lower, _, _] in bounds.rows {
            let margin = 0.018;
            assert!(ils >= ib - margin && ib >= ir - margin);
            assert!((ib - bootstrapped).abs() < margin && adop >= bootstrapped - 1e-12, "{ib} {bootstrapped} {adop}");
            assert!(upper >= ils - margin && slabs >= ils - margin, "{upper} {slabs} {ils}");
            assert!(ball <= ils + margin && lower <= ir + margin && bootstrapped <= ils + margin);
        }
    }
}
