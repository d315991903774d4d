//! The adaptive post-processing algorithm: Algorithm 2 of Greiff et al. (2023).
//!
//! ```text
//! forward, detecting slips ─► EM with these slips ─► RTSAP with the learned noise, detecting slips anew
//! ```

use super::em::{self, EmOptions, EmReport};
use super::model::Model;
use super::pass::{Epoch, PassError, Passes};
use super::rtsap::{self, Posterior, RtsapOptions, RtsapReport};

/// What EM learns on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LearnOn {
    /// Ambiguities are real numbers, as in the paper.
    #[default]
    Relaxed,
    /// Integers are fixed first: fewer states, and noise that no float ambiguity can take for its own. The integers have to
    /// be right with the noise that EM starts from.
    Fixed,
}

/// What is done.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AppOptions {
    /// How EM learns.
    pub em: EmOptions,
    /// What it learns on.
    pub learn_on: LearnOn,
    /// The passes with the learned noise.
    pub rtsap: RtsapOptions,
}

/// What came of it.
#[derive(Clone, Debug, PartialEq)]
pub struct AppReport {
    /// What was learned.
    pub em: EmReport,
    /// The passes with the learned noise.
    pub rtsap: RtsapReport,
}

/// Learns the noise and runs [`rtsap::rtsap`] with it, to whose visitor `visit` corresponds. The model keeps what was
/// learned.
pub fn app<M: Model + Clone + Send + Sync>(
    model: &mut M,
    passes: &mut Passes<'_>,
    options: &AppOptions,
    visit: impl FnMut(Posterior, Epoch<'_>),
) -> Result<AppReport, PassError> {
    passes.expect(model, 1);
    model.release();
    if options.rtsap.detect {
        passes.forward_detecting(model)?;
    } else {
        passes.forward(model)?;
    }
    if options.learn_on == LearnOn::Fixed {
        passes.expect(model, 1);
        rtsap::fix(model, passes, &options.rtsap, |_| ())?;
    }
    let em = em::learn(model, passes, &options.em)?;
    let rtsap = rtsap::rtsap(model, passes, &options.rtsap, visit)?;
    Ok(AppReport { em, rtsap })
}

#[cfg(test)]
mod tests {
    use super::super::batch::ambiguous;
    use super::super::pass::PassOptions;
    use super::*;

    /// The walk is drawn with 0.3 m; of 200 steps its standard deviation is known to 5 %.
    #[test]
    fn noise_that_was_wrong_by_tens_is_learned_on_either_model() {
        for learn_on in [LearnOn::Relaxed, LearnOn::Fixed] {
            for factor in [0.1, 10.0] {
                let (mut model, _) = ambiguous(11, 201, 6, 60);
                model.set_variances(&[0.09 * factor]);
                let options = AppOptions { learn_on, ..AppOptions::default() };
                let mut passes = Passes::new(PassOptions::default());
                let report = app(&mut model, &mut passes, &options, |_, _| ()).unwrap();
                let sigma = report.em.end[0].sqrt();
                assert!(
                    (sigma / 0.3 - 1.0).abs() < 0.2 && report.em.converged,
                    "{learn_on:?} {factor}: {:?}",
                    report.em
                );
                assert_eq!(model.parameters()[0].variance, report.em.end[0]);
            }
        }
    }
}
