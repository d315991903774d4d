//! Protection levels of the engine's answers.
//!
//! The covariance of the reported density, turned to east, north, up, times the K factors of the configuration, widened
//! where the innovations of the last [`WINDOW`] epochs exceed theirs ([`crate::integrity`]). A fixed position that may not
//! count as right by the configured rule has the protection level of the float one. Panic contract: none.

use crate::filter::update::Gauge;
use crate::gnss::geodesy::Geodetic;
use crate::gnss::solution::{Quality, Solution};
use crate::integrity::protection::{Basis, Config, Factors, Levels};
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
}

impl Monitor {
    pub const fn new() -> Self {
        Self { factors: None, window: NisWindow::new(), float: None }
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

    /// Writes protection levels and status into an answer. A configuration that contradicts itself bounds nothing.
    pub fn bound(&mut self, config: &Config, solution: &mut Solution) {
        let float = self.float.take();
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
            Quality::Code => levels(own, 1.0),
            Quality::Float => levels(own, self.window.inflation()),
            Quality::Fixed | Quality::Partial => {
                // The engine reports integers only if a test of the data accepted them.
                let basis = factors.basis(1.0 - solution.success_rate, true);
                let covariance = if basis == Basis::Float { float.unwrap_or(*own) } else { *own };
                levels(&covariance, self.window.inflation())
            }
        };
        solution.integrity = factors.status(solution.protection);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gnss::solution::Reason;
    use crate::gnss::time::GpsTime;
    use crate::integrity::protection::{Rule, Status};
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
