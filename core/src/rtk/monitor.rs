//! Protection levels of the engine's answers.
//!
//! The covariance of the reported density, turned to east, north, up, times the K factors of the configuration, widened
//! where the innovations of the last [`WINDOW`] epochs exceed theirs ([`crate::integrity`]); those of a single point where
//! its residuals exceed the usual ([`crate::spp::SinglePoint::inflation`]). A fixed position that may not
//! count as right by the configured rule has the protection level of the float one. Where faults are looked for
//! ([`super::fault`]), a level is at least what one that was not noticed may do; an alarm that no exclusion explains makes the
//! status [`Status::Alert`] whatever the levels, and a fix that cannot be checked has none. Panic contract: none.

use super::fault::Bound;
use crate::filter::update::Gauge;
use crate::gnss::geodesy::Geodetic;
use crate::gnss::solution::{Quality, Solution};
use crate::integrity::protection::{Basis, Config, Factors, Levels, Status};
use crate::integrity::window::NisWindow;
use nalgebra::Matrix3;

/// Epochs over which innovations are compared with their covariance.
const WINDOW: usize = 30;

/// What bounds the answers.
pub(super) struct Monitor {
    /// Those of the configuration that follows, and it.
    factors: Option<(Config, Factors)>,
    window: NisWindow<WINDOW>,
    /// Covariance of the float position of this epoch, ECEF.
    float: Option<Matrix3<f64>>,
    /// By what residuals widen a single point's standard deviations.
    code: f64,
    /// What faults may do to the answer of this epoch; none where they are not looked for.
    faults: Option<Bound>,
}

impl Monitor {
    pub const fn new() -> Self {
        Self { factors: None, window: NisWindow::new(), float: None, code: 1.0, faults: None }
    }

    /// Forgets the innovations.
    pub fn clear(&mut self) {
        self.window.clear();
    }

    /// Takes the innovations of an update and the float position's covariance that came of it.
    pub fn note(&mut self, gauge: Gauge<f64>, float: Matrix3<f64>) {
        self.window.push(gauge.normalized_innovation_squared, gauge.rows);
        self.float = Some(float);
    }

    /// Takes by what the residuals of this epoch's single point widen its standard deviations.
    pub fn note_code(&mut self, inflation: f64) {
        self.code = inflation;
    }

    /// Takes what faults may do to the answer of this epoch.
    pub fn bound_faults(&mut self, bound: Bound) {
        self.faults = Some(bound);
    }

    /// Writes protection levels and status into an answer. A configuration that contradicts itself bounds nothing.
    pub fn bound(&mut self, config: &Config, solution: &mut Solution) {
        let (float, faults) = (self.float.take(), self.faults.take());
        if self.factors.as_ref().is_none_or(|(of, _)| of != config) {
            self.factors = config.factors().ok().map(|factors| (*config, factors));
        }
        let Some((_, factors)) = &self.factors else { return };
        let levels = |covariance: &Matrix3<f64>, inflation: f64| -> Option<Levels> {
            let rotation = Geodetic::from_ecef(&solution.position).enu_rotation();
            factors.levels(&(rotation * covariance * rotation.transpose()), inflation)
        };
        let own = &solution.position_covariance;
        solution.protection = match solution.quality {
            Quality::None => None,
            Quality::Code => levels(own, self.code),
            Quality::Float => levels(own, self.window.inflation()),
            Quality::Fixed | Quality::Partial => {
                // The engine reports integers only if a test of the data accepted them.
                let basis = factors.basis(1.0 - solution.success_rate, true);
                let covariance = if basis == Basis::Float { float.unwrap_or(*own) } else { *own };
                levels(&covariance, self.window.inflation())
            }
        };
        match faults {
            None => {}
            Some(Bound::Within(most)) => {
                let inflation = self.window.inflation();
                let [horizontal, vertical] = most.map(|level| inflation * level);
                solution.protection = solution
                    .protection
                    .filter(|_| horizontal.is_finite() && vertical.is_finite())
                    .map(|levels| Levels {
                        horizontal: levels.horizontal.max(horizontal),
                        vertical: levels.vertical.max(vertical),
                    });
            }
            Some(Bound::Unresolved) => {
                solution.integrity = if solution.protection.is_some() { Status::Alert } else { Status::Unmonitored };
                return;
            }
            Some(Bound::Unchecked) => solution.protection = None,
        }
        solution.integrity = factors.status(solution.protection);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gnss::solution::Reason;
    use crate::gnss::time::GpsTime;
    use crate::integrity::protection::Rule;
    use nalgebra::Vector3;

    /// On the equator at longitude 0, up is x: variances (u, e, n) = (4, 1, 1) cm². K = 5.345837350732903 for a risk of 1e-7
    /// each with 1e-8 for wrong integers.
    fn solution(quality: Quality) -> Solution {
        Solution {
            quality,
            position: Vector3::new(6_378_137.0, 0.0, 0.0),
            position_covariance: Matrix3::from_diagonal(&Vector3::new(4e-4, 1e-4, 1e-4)),
            success_rate: 0.999,
            ..Solution::none(GpsTime::from_week_tow(2100, 0.0), Reason::Complete)
        }
    }

    fn gauge(squares: f64) -> Gauge<f64> {
        Gauge { rows: 10, normalized_innovation_squared: squares, log_determinant: 0.0 }
    }

    /// A level is the larger of the two; a fault without a name is an alert, and what cannot be checked has no level.
    #[test]
    fn faults_widen_levels_or_take_the_status() {
        let config = Config::default();
        let answer = |bound| {
            let mut monitor = Monitor::new();
            monitor.note(gauge(5.0), Matrix3::identity());
            monitor.bound_faults(bound);
            let mut solution = solution(Quality::Fixed);
            monitor.bound(&config, &mut solution);
            (solution.protection, solution.integrity)
        };
        let (levels, status) = answer(Bound::Within([0.5, 0.01]));
        assert_eq!((levels.unwrap().horizontal, status), (0.5, Status::Available));
        assert!((levels.unwrap().vertical - 0.02 * 5.345_837_350_732_903).abs() < 1e-12);
        assert_eq!(answer(Bound::Within([1.5, 0.01])).1, Status::Alert);
        assert_eq!(answer(Bound::Within([f64::INFINITY; 2])), (None, Status::Unmonitored));
        assert_eq!(answer(Bound::Unchecked), (None, Status::Unmonitored));
        let (levels, status) = answer(Bound::Unresolved);
        assert!(levels.is_some() && status == Status::Alert);
    }

    #[test]
    fn answers_are_bounded_as_configured() {
        let k = 5.345_837_350_732_903;
        let float = Matrix3::identity();
        let mut monitor = Monitor::new();
        let mut answer = |config: &Config, quality, squares| {
            monitor.clear();
            monitor.note(gauge(squares), float);
            let mut solution = solution(quality);
            monitor.bound(config, &mut solution);
            (solution.protection, solution.integrity)
        };
        let config = Config::default();
        let (levels, status) = answer(&config, Quality::Fixed, 5.0);
        let levels = levels.unwrap();
        assert!(
            (levels.vertical - 0.02 * k).abs() < 1e-12 && (levels.horizontal - 0.01 * 2f64.sqrt() * k).abs() < 1e-12
        );
        assert_eq!(status, Status::Available);
        // Innovations four times as large in square: twice the level.
        let (wide, _) = answer(&config, Quality::Fixed, 40.0);
        assert!((wide.unwrap().vertical - 0.04 * k).abs() < 1e-12);
        // By the strict rule 0.999 is not sure enough: the float position counts, K metres up.
        let strict = Config { rule: Rule::SuccessRate, ..config };
        let (levels, status) = answer(&strict, Quality::Fixed, 5.0);
        assert!((levels.unwrap().vertical - k).abs() < 1e-12);
        assert_eq!(status, Status::Alert);
        assert_eq!(answer(&config, Quality::None, 5.0), (None, Status::Unmonitored));
        let contradictory = Config { alert_limits: [-1.0, 1.0], ..config };
        assert_eq!(answer(&contradictory, Quality::Fixed, 5.0), (None, Status::Unmonitored));
    }
}
