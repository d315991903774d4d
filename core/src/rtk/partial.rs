//! Fixing a part of the ambiguities where the whole set was not accepted, by the configured rule ([`Partial`]).
//!
//! * weakest: the least trusted eighth goes, again and again.
//! * elevation, search: satellites go, chosen by the success rate ([`crate::integer::subset`]); where the data refuse such
//!   a set, its least trusted satellite goes.
//! * decorrelated: integer combinations instead of single ambiguities ([`crate::integer::partial`]); where the data refuse
//!   them, the least trusted eighth of the ambiguities goes.
//!
//! Every set has to pass the tests of the whole one. With [`Acceptance::assist`](super::config::Acceptance::assist) the
//! accepted ones then help the rest, satellite by satellite, by the same thresholds: product of all success rates, ratio.
//!
//! Panic contract: none. At most [`MAX_SUBSETS`] sets are searched for integers in an epoch, and as many success rates
//! computed as there are satellites, or the budget of a search.

use super::RtkFilter;
use super::config::Partial;
use super::fix::{Accepted, Found, KINEMATIC, STATES};
use crate::gnss::solution::{Reason, Solution};
use crate::integer::condition::condition_on_combinations;
use crate::integer::partial::resolve_partial;
use crate::integer::subset::{self, Options, Strategy};
use crate::integer::success_rate::Probability;
use crate::integer::{Config, IntegerError};
use crate::linalg::{Mat, MatMut};

/// Most sets searched for integers in one epoch.
const MAX_SUBSETS: usize = 10;

impl<const C: usize, const N: usize, const E: usize> RtkFilter<C, N, E> {
    /// Fixes a part of the candidates, of which the whole was not accepted; false if none can be.
    pub(super) fn fix_part(&mut self, solution: &mut Solution) -> bool {
        match self.config.acceptance.partial {
            Partial::Weakest => self.fix_without_the_weakest(solution),
            Partial::Elevation => self.fix_satellites(solution, None),
            Partial::Search { budget } => self.fix_satellites(solution, Some(budget)),
            Partial::Decorrelated => self.fix_combinations(solution),
        }
    }

    /// The states of the most trusted candidates, the least trusted eighth of `count` (at least one) left out; false if
    /// too few are left.
    fn leave_out_an_eighth(&mut self, count: &mut usize) -> bool {
        *count = count.saturating_sub((*count / 8).max(1));
        let work = &mut self.integers;
        work.take_all();
        work.sets.states.truncate(*count);
        *count >= self.least_ambiguities()
    }

    fn fix_without_the_weakest(&mut self, solution: &mut Solution) -> bool {
        let mut count = self.integers.ambiguities.len();
        for _ in 1..MAX_SUBSETS {
            if !self.leave_out_an_eighth(&mut count) {
                break;
            }
            if let Some(accepted) = self.accept(solution, false) {
                // Of a satellite that was cut in two the rest may be helped as well.
                self.integers.sets.trial.clear();
                self.help_rest(solution, &accepted);
                if self.constrain(solution) {
                    return true;
                }
            }
        }
        false
    }

    /// By elevation, or by a search with a budget.
    fn fix_satellites(&mut self, solution: &mut Solution, budget: Option<u16>) -> bool {
        let acceptance = self.config.acceptance;
        let work = &mut self.integers;
        if work.sets.begin(work.of.iter().copied()).is_err() {
            return false;
        }
        let mut left = budget;
        for _ in 1..MAX_SUBSETS {
            let options = Options {
                strategy: left.map_or(Strategy::Elevation, |budget| Strategy::Search { budget }),
                min_success: acceptance.success_rate.min(acceptance.success_rate_confirmed),
                min_satellites: acceptance.min_satellites,
                ..Options::default()
            };
            let whole = self.integers.ambiguities.len();
            let Some((problem, sets, mut scratch)) = self.integers.subset(&self.density) else { return false };
            let chosen = match subset::choose(&problem, &options, sets, &mut scratch) {
                Ok(Some(chosen)) => chosen,
                Ok(None) => return false,
                Err(_) => {
                    solution.reason = Reason::Inconsistent;
                    return false;
                }
            };
            left = left.map(|budget| budget.saturating_sub(chosen.examined.min(usize::from(u16::MAX)) as u16));
            if sets.states.len() < self.least_ambiguities() {
                return false;
            }
            // The whole set was tried before.
            if self.integers.sets.states.len() < whole
                && let Some(accepted) = self.accept(solution, false)
            {
                self.help_rest(solution, &accepted);
                if self.constrain(solution) {
                    return true;
                }
            }
            self.integers.sets.trial.pop();
        }
        false
    }

    /// What is accepted helps the rest, where that is configured. Those helped are held to what integers that were never
    /// proven are held to, also by integers that were.
    fn help_rest(&mut self, solution: &mut Solution, accepted: &Accepted) {
        let acceptance = self.config.acceptance;
        if !acceptance.assist {
            return;
        }
        let options = Options {
            min_success: acceptance.success_rate,
            min_ratio: acceptance.ratio,
            variance_factor: accepted.variance_factor,
            ..Options::default()
        };
        let so_far = Probability { success: solution.success_rate, failure: 1.0 - solution.success_rate };
        let Some((problem, sets, mut scratch)) = self.integers.subset(&self.density) else { return };
        let fixed = sets.states.len();
        match subset::help_rest(&problem, &options, so_far, sets, &mut scratch) {
            Ok(product) => solution.success_rate = product.success,
            Err(_) => {
                sets.states.truncate(fixed);
                sets.values.truncate(fixed);
            }
        }
    }

    fn fix_combinations(&mut self, solution: &mut Solution) -> bool {
        let mut count = self.integers.ambiguities.len();
        let work = &mut self.integers;
        work.take_all();
        let mut enough = count >= self.least_ambiguities();
        for _ in 1..MAX_SUBSETS {
            if !enough {
                break;
            }
            if self.try_combinations(solution) {
                return true;
            }
            enough = self.leave_out_an_eighth(&mut count);
        }
        false
    }

    /// Fixes combinations of the states of the subset; on success the solution holds the constrained density.
    fn try_combinations(&mut self, solution: &mut Solution) -> bool {
        let acceptance = self.config.acceptance;
        let kinematic = if self.config.motion.order() > 1 { KINEMATIC } else { 3 };
        let (mut mean, mut covariance) = ([0.0; KINEMATIC], [[0.0; KINEMATIC]; KINEMATIC]);
        let least_rate = acceptance.success_rate.min(acceptance.success_rate_confirmed);
        let channels = self.channels.as_slice();
        let integer_at = |state| channels.iter().find(|channel| channel.state == Some(state))?.fixed;
        let (n, work) = (self.density.dim(), &mut self.integers);
        let outcome = (|| {
            let count = work.gather(&self.density)?;
            let all = Mat::new(self.density.covariance_flat(), n, n, N)?;
            let q = Mat::new(work.covariance.as_flattened(), count, count, C)?;
            let (a, config) = (work.vector.get(..count).ok_or(IntegerError::Capacity)?, Config::default());
            let resolution = resolve_partial(a, q, least_rate, &config, &mut work.workspace)?;
            let m = resolution.values.len();
            condition_on_combinations(
                self.density.mean(),
                all,
                &STATES[..kinematic],
                &work.sets.states,
                &resolution,
                &mut MatMut::new(work.cross.as_flattened_mut(), m, kinematic, KINEMATIC)?,
                &mut mean[..kinematic],
                &mut MatMut::new(covariance.as_flattened_mut(), kinematic, kinematic, KINEMATIC)?,
            )?;
            work.vector.iter_mut().zip(resolution.variances).for_each(|(variance, &found)| *variance = found);
            let found = Found {
                full_success: resolution.success_rate.success,
                norm: resolution.best_norm,
                ratio: resolution.ratio,
                method: resolution.method,
            };
            let confirmed = resolution.combinations.iter().zip(resolution.values).all(|(row, &value)| {
                let terms = row.iter().zip(&work.sets.states).filter(|(t, _)| **t != 0);
                let sum = terms.map(|(&t, &state)| Some(t as f64 * integer_at(state)?)).sum::<Option<f64>>();
                sum == Some(value as f64)
            });
            Ok::<_, IntegerError>((m, found, confirmed))
        })();
        let Ok((m, found, confirmed)) = outcome else {
            solution.reason = Reason::Inconsistent;
            return false;
        };
        if m < self.least_ambiguities() {
            return false;
        }
        if self.judge(solution, &found, m, confirmed, false).is_none() {
            return false;
        }
        self.report_conditional(solution, &mean, &covariance, m);
        // Single integers that were proven before stay so where the combinations agree with them.
        if !confirmed {
            self.forget_integers();
        }
        true
    }
}
