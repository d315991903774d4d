//! Fault detection and exclusion.
//!
//! Detection: the global test Σ r²/σ² against χ² with the fit's degrees of freedom, and the local test, the largest
//! |w| with w = r / sd(r), sd(r)² = σ² − a (Aᵀ W A)⁻¹ aᵀ (W. Baarda, *A testing procedure for use in geodetic
//! networks*, 1968). The global test sees many small inconsistencies, the local one a single fault among many
//! satellites.
//!
//! Identification: for one fault, leaving out satellite i lowers χ² by exactly w_i² (Teunissen, *Testing Theory*, 2006,
//! section 4.4), so the largest |w| *is* the best leave-one-out, without solving n times. Several gross faults mask each
//! other in w; therefore the first candidates are those that a robust fit disowns, and what was excluded wrongly is taken
//! back at the end. A subset is accepted only if at least one degree of freedom is left to test it with.
//!
//! Bounded: at most one exclusion and one readmission a row. Panic contract: never panics.

use super::SinglePointError;
use super::adjust::{Adjustment, Model, Unknowns, adjust, equations, robust_start};
use crate::gnss::satellite::{SatelliteId, SatelliteSet};
use crate::stats::chi_square;

/// Thresholds of the tests.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FaultTests {
    /// Probability that the global test rejects a fit without fault.
    pub false_alarm: f64,
    /// Largest |w| of a fit without fault.
    pub outlier: f64,
}

impl FaultTests {
    /// 0.001, and 4 standard deviations (6e-5 per satellite).
    pub const DEFAULT: Self = Self { false_alarm: 1e-3, outlier: 4.0 };
}

impl Default for FaultTests {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// A fit that passes the tests, and what had to be left out for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Consistent {
    /// The fit.
    pub fit: Adjustment,
    /// Satellites excluded as faulty.
    pub excluded: SatelliteSet,
}

/// Fits the rows, leaving out those that contradict the others.
pub fn adjust_consistent<M: Model>(
    model: &M,
    rows: &[M::Row],
    start: Unknowns,
    tests: &FaultTests,
) -> Result<Consistent, SinglePointError> {
    let search = Search { model, rows, tests };
    let all = SatelliteSet::EMPTY;
    match adjust(model, rows, &all, start) {
        Ok(fit) if search.passes(&fit, &all) => return Ok(Consistent { fit, excluded: all }),
        Err(SinglePointError::TooFewSatellites) => return Err(SinglePointError::TooFewSatellites),
        _ => {}
    }
    let found = search.exclude(start)?;
    Ok(search.readmit(found))
}

struct Search<'a, M: Model> {
    model: &'a M,
    rows: &'a [M::Row],
    tests: &'a FaultTests,
}

impl<M: Model> Search<'_, M> {
    /// Whether a fit passes both tests. Without redundancy nothing can be tested, and nothing was excluded.
    fn passes(&self, fit: &Adjustment, excluded: &SatelliteSet) -> bool {
        if fit.degrees_of_freedom == 0 {
            return excluded.is_empty();
        }
        chi_square::survival(fit.chi_square, fit.degrees_of_freedom) >= self.tests.false_alarm
            && self.worst(fit, excluded).is_none_or(|(_, w)| w <= self.tests.outlier)
    }

    /// The satellite with the largest |w|.
    fn worst(&self, fit: &Adjustment, excluded: &SatelliteSet) -> Option<(SatelliteId, f64)> {
        equations(self.model, self.rows, excluded, &fit.unknowns)
            .filter_map(|(satellite, equation)| {
                let variance = equation.variance - fit.prediction_variance(&equation);
                // Alone with its own bias, a satellite has no residual and cannot be tested.
                let testable = variance > 1e-6 * equation.variance;
                testable.then(|| (satellite, libm::fabs(equation.residual) / libm::sqrt(variance)))
            })
            .max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Excludes until the rest passes.
    fn exclude(&self, start: Unknowns) -> Result<Consistent, SinglePointError> {
        let mut start = start;
        let mut excluded = SatelliteSet::EMPTY;
        if let Ok(robust) = robust_start(self.model, self.rows, start) {
            let disowned = equations(self.model, self.rows, &SatelliteSet::EMPTY, &robust)
                .filter(|(_, e)| libm::fabs(e.residual) > self.tests.outlier * libm::sqrt(e.variance))
                .map(|(satellite, _)| satellite)
                .collect();
            if adjust(self.model, self.rows, &disowned, robust).is_ok_and(|fit| fit.degrees_of_freedom > 0) {
                excluded = disowned;
                start = robust;
            }
        }
        for _ in 0..=self.rows.len() {
            let fit = adjust(self.model, self.rows, &excluded, start)?;
            if self.passes(&fit, &excluded) {
                return Ok(Consistent { fit, excluded });
            }
            match self.worst(&fit, &excluded) {
                Some((satellite, _)) if fit.degrees_of_freedom > 1 => excluded.insert(satellite),
                _ => return Err(SinglePointError::Inconsistent),
            };
        }
        Err(SinglePointError::Inconsistent)
    }

    /// Takes back what agrees with the fit, the best first.
    fn readmit(&self, mut found: Consistent) -> Consistent {
        for _ in 0..found.excluded.len() {
            let nearest = equations(self.model, self.rows, &found.fit.used, &found.fit.unknowns)
                .filter(|(_, e)| found.fit.groups.get(e.group).is_some_and(|&known| known))
                .map(|(satellite, equation)| {
                    let variance = equation.variance + found.fit.prediction_variance(&equation);
                    (satellite, equation.residual * equation.residual / variance)
                })
                .min_by(|a, b| a.1.total_cmp(&b.1));
            let Some((satellite, square)) = nearest else { break };
            if square > self.tests.outlier * self.tests.outlier {
                break;
            }
            let mut excluded = found.excluded;
            excluded.remove(satellite);
            match adjust(self.model, self.rows, &excluded, found.fit.unknowns) {
                Ok(fit) if self.passes(&fit, &excluded) => found = Consistent { fit, excluded },
                _ => break,
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spp::position::PositionModel;
    use crate::spp::rows::Row;
    use crate::spp::sky::{ATMOSPHERE, RECEIVER, sky};
    use proptest::prelude::*;

    const MODEL: PositionModel = PositionModel { atmosphere: ATMOSPHERE };

    fn solve(rows: &[Row]) -> Result<Consistent, SinglePointError> {
        adjust_consistent(&MODEL, rows, Unknowns::default(), &FaultTests::DEFAULT)
    }

    fn names(excluded: SatelliteSet) -> Vec<String> {
        excluded.iter().map(|satellite| satellite.to_string()).collect()
    }

    #[test]
    fn one_fault_is_found() {
        for faulty in 0..9 {
            let mut rows = sky(&[9, 0, 0, 0, 0]);
            rows[faulty].code += 100.0;
            let found = solve(&rows).unwrap();
            assert_eq!(names(found.excluded), [rows[faulty].satellite.to_string()]);
            assert!((found.fit.unknowns.vector - RECEIVER).norm() < 1e-5);
        }
    }

    #[test]
    fn many_gross_faults_are_found() {
        // 9 of 28, of one sign and alike, as multipath of a street is, and some absurd.
        let mut rows = sky(&[8, 7, 6, 2, 5]);
        for (faulty, error) in
            [(1, 80.0), (4, 90.0), (7, 120.0), (9, 70.0), (12, 85.0), (15, 3e6), (17, -4e5), (20, 60.0), (24, 1e4)]
        {
            rows[faulty].code += error;
        }
        let found = solve(&rows).unwrap();
        assert!((found.fit.unknowns.vector - RECEIVER).norm() < 1e-5);
        assert_eq!(found.excluded.len(), 9);
    }

    #[test]
    fn a_fault_that_cannot_be_located_is_not_guessed() {
        // Five satellites, four unknowns: the contradiction shows, but each of them explains it.
        let mut rows = sky(&[5, 0, 0, 0, 0]);
        rows[2].code += 100.0;
        assert_eq!(solve(&rows), Err(SinglePointError::Inconsistent));
    }

    #[test]
    fn the_local_test_sees_what_the_global_one_does_not() {
        // 6.5 σ on one of 28 satellites: χ² = 42 at most, of which 20 degrees of freedom expect 20 ± 6.
        let mut rows = sky(&[8, 7, 6, 2, 5]);
        rows[3].code += 6.5;
        let fit = adjust(&MODEL, &rows, &SatelliteSet::EMPTY, Unknowns::default()).unwrap();
        assert!(chi_square::survival(fit.chi_square, fit.degrees_of_freedom) > FaultTests::DEFAULT.false_alarm);
        assert_eq!(names(solve(&rows).unwrap().excluded), ["G04"]);
    }

    proptest! {
        #[test]
        fn noise_within_its_sigma_excludes_nothing(noise in proptest::collection::vec(-1.7..1.7f64, 28)) {
            let mut rows = sky(&[8, 7, 6, 2, 5]);
            rows.iter_mut().zip(&noise).for_each(|(row, noise)| row.code += noise);
            prop_assert!(solve(&rows).unwrap().excluded.is_empty());
        }

        #[test]
        fn a_fault_within_noise_is_excluded_and_the_rest_is_used(
            noise in proptest::collection::vec(-1.0..1.0f64, 28), faulty in 0..28usize,
            error in prop_oneof![-1e6..-50.0f64, 50.0..1e6f64],
        ) {
            let mut rows = sky(&[8, 7, 6, 2, 5]);
            rows.iter_mut().zip(&noise).for_each(|(row, noise)| row.code += noise);
            rows[faulty].code += error;
            let found = solve(&rows).unwrap();
            // QZSS has two satellites here: which of them is wrong cannot be told, and does not matter.
            let qzss = (21..23).contains(&faulty);
            prop_assert!(found.excluded.len() == 1 && (qzss || found.excluded.contains(rows[faulty].satellite)));
            prop_assert!((found.fit.unknowns.vector - RECEIVER).norm() < 3.0);
        }
    }
}
