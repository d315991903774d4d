//! RTS smoothing with adaptive ambiguity priors and fixed integers: Algorithm 1 of Greiff et al. (2023).
//!
//! ```text
//! relaxed: forward, detecting slips ─► backward ─► integers ─► the model drops them ─► fixed: forward ─► backward
//! ```
//! Whichever density the integers came from, the visitor sees the filtered and the smoothed density of every epoch of both
//! passes: the paper's "filtering" rows are the fixed *filter*, its "smoothing" rows the fixed *smoother*.

use super::integers::{Fixer, IntegerOptions, IntegerReport};
use super::model::Model;
use super::pass::{Epoch, Fit, PassError, Passes};

/// Which of the passes an epoch belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Posterior {
    /// Ambiguities are real numbers.
    Relaxed,
    /// Fixed integers are known.
    Fixed,
}

/// What is done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RtsapOptions {
    /// Whether the relaxed pass detects slips.
    pub detect: bool,
    /// How integers are fixed.
    pub integers: IntegerOptions,
    /// How often integers are fixed: the second time on the posterior that the first left, and so on; it ends early when
    /// there is nothing more to fix.
    pub rounds: usize,
}

impl Default for RtsapOptions {
    fn default() -> Self {
        Self { detect: true, integers: IntegerOptions::default(), rounds: 1 }
    }
}

/// What came of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RtsapReport {
    /// Innovations of the relaxed forward pass.
    pub relaxed: Fit,
    /// Integers of each round.
    pub integers: Vec<IntegerReport>,
    /// Innovations of the fixed forward pass.
    pub fixed: Fit,
}

/// Runs the relaxed and the fixed pass; the model keeps its fixes. `visit` gets every epoch twice, relaxed and fixed, from
/// the last to the first.
pub fn rtsap<M: Model + ?Sized>(
    model: &mut M,
    passes: &mut Passes<'_>,
    options: &RtsapOptions,
    mut visit: impl FnMut(Posterior, Epoch<'_>),
) -> Result<RtsapReport, PassError> {
    passes.expect(model, 4);
    model.release();
    let relaxed = if options.detect { passes.forward_detecting(model)? } else { passes.forward(model)? };
    let mut integers = vec![fix(model, passes, options, |epoch| visit(Posterior::Relaxed, epoch))?];
    for _ in 1..options.rounds {
        passes.expect(model, 2);
        passes.forward(model)?;
        let report = fix(model, passes, options, |_| ())?;
        let more = report.found();
        integers.push(report);
        if !more {
            break;
        }
    }
    let fixed = passes.forward(model)?;
    passes.backward(model, |epoch| visit(Posterior::Fixed, epoch))?;
    Ok(RtsapReport { relaxed, integers, fixed })
}

/// A backward pass whose integers the model gets.
pub(super) fn fix<M: Model + ?Sized>(
    model: &mut M,
    passes: &mut Passes<'_>,
    options: &RtsapOptions,
    mut visit: impl FnMut(Epoch<'_>),
) -> Result<IntegerReport, PassError> {
    let mut fixer = Fixer::new(options.integers);
    passes.backward(model, |epoch| {
        fixer.visit(model, epoch);
        visit(epoch);
    })?;
    Ok(fixer.apply(model))
}

#[cfg(test)]
mod tests {
    use super::super::batch::ambiguous;
    use super::super::integers::{Search, Source};
    use super::super::pass::PassOptions;
    use super::*;

    /// Root mean square error of the position in the fixed smoother, and that of its density.
    #[test]
    fn fixing_takes_the_position_from_decimetres_to_centimetres_for_all_combinations() {
        let mut results = Vec::new();
        for source in [Source::Filter, Source::Smoother] {
            let (mut model, _) = ambiguous(7, 200, 6, 60);
            let mut passes = Passes::new(PassOptions::default());
            let integers = IntegerOptions { source, search: Search::LeastSquares, ..IntegerOptions::default() };
            let options = RtsapOptions { integers, ..RtsapOptions::default() };
            let mut sigma = [[0.0; 2]; 2];
            let mut seen = [0; 2];
            let report = rtsap(&mut model, &mut passes, &options, |posterior, epoch| {
                let row = usize::from(posterior == Posterior::Fixed);
                seen[row] += 1;
                sigma[row][0] += epoch.filtered.covariance(0, 0) / 200.0;
                sigma[row][1] += epoch.smoothed.covariance(0, 0) / 200.0;
            })
            .unwrap();
            assert_eq!(seen, [200; 2]);
            assert_eq!((report.integers[0].torn_arcs, report.integers[0].contradictions), (0, 0));
            let [relaxed, fixed] = sigma;
            assert!(fixed[0] < relaxed[0] && fixed[1] < relaxed[1] && fixed[1] <= fixed[0], "{sigma:?}");
            results.push(sigma[1][1]);
        }
        assert!(results.iter().all(|variance| variance.sqrt() < 0.05), "{results:?}");
    }

    #[test]
    fn further_rounds_end_when_nothing_is_left() {
        let (mut model, _) = ambiguous(7, 200, 6, 60);
        let options = RtsapOptions { rounds: 9, ..RtsapOptions::default() };
        let report = rtsap(&mut model, &mut Passes::new(PassOptions::default()), &options, |_, _| ()).unwrap();
        assert!(report.integers.len() < 9 && !report.integers[report.integers.len() - 1].found());
    }
}
