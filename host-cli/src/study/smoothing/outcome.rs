//! What the runs of a row come to: the statistics (22) and (23) and those of Table 2.
//!
//! ```text
//! RMSE_k = √(mean over runs of |e_k|²),  RAPC_k = √(mean of Tr Σ_k)
//! TA-RMSE = mean over k of RMSE_k,  S-RMSE = RMSE_{K/2},  S-RAPC = RAPC_{K/2},  TA-IFA = share of right integers
//! ```
//! RMSE at a single epoch is uncertain by some 6 % after 80 runs; hence also over a window of ±K/10 about the middle, and
//! the ratio RMSE/RAPC there, which is 1 for a consistent estimate. Standard errors are those of [`Estimate`]; that of
//! TA-RMSE is to first order.

use super::super::statistics::{Estimate, Tally};
use super::trial::{Fixed, Position, Posterior};
use std::ops::RangeInclusive;

/// Numbers of a row.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// TA-RMSE `[m]`.
    pub mean_rmse: Estimate,
    /// S-RMSE at K/2 `[m]`.
    pub middle_rmse: Estimate,
    /// RMSE over the window `[m]`.
    pub window_rmse: Estimate,
    /// S-RAPC at K/2 `[m]`.
    pub middle_rapc: f64,
    /// RMSE/RAPC over the window.
    pub ratio: Estimate,
    /// TA-IFA `[%]`.
    pub right: Estimate,
    /// Mean computing time of a run `[s]`.
    pub seconds: f64,
    /// RMSE of each epoch `[m]`.
    pub rmse: Vec<f64>,
    /// RAPC of each epoch `[m]`.
    pub rapc: Vec<f64>,
}

/// The epochs about the middle that are stationary, of epochs 0 to `last`.
pub fn window(last: usize) -> RangeInclusive<usize> {
    let (middle, half) = (last / 2, last / 10);
    middle.saturating_sub(half)..=middle + half
}

impl Outcome {
    /// Of all runs, for one of the two estimates.
    pub fn of(runs: &[&Fixed], estimate: Posterior) -> Self {
        let tracks: Vec<&[Position]> = runs.iter().map(|run| run.positions[estimate as usize].as_slice()).collect();
        let epochs = tracks.iter().map(|track| track.len()).min().unwrap_or(0);
        let count = runs.len() as f64;
        let mean = |of: fn(&Position) -> f64| -> Vec<f64> {
            (0..epochs).map(|k| (tracks.iter().map(|track| of(&track[k])).sum::<f64>() / count).sqrt()).collect()
        };
        let (rmse, rapc) = (mean(square), mean(|position| position.trace));
        // d TA-RMSE = mean over k of d(RMSE_k²)/(2 RMSE_k).
        let influence = |track: &[Position]| -> f64 {
            let terms = track.iter().zip(&rmse).filter(|(_, rmse)| **rmse > 0.0);
            terms.map(|(position, rmse)| (square(position) + rmse * rmse) / (2.0 * rmse)).sum::<f64>() / epochs as f64
        };
        let single = |sum: f64| Tally { sum, count: 1.0 };
        let last = epochs.saturating_sub(1);
        let over = |range: RangeInclusive<usize>, of: fn(&Position) -> f64| {
            tracks.iter().map(move |track| {
                let (low, high) = (*range.start(), *range.end());
                let inside = track.iter().take(high + 1).skip(low);
                inside.fold(Tally::default(), |mut tally, position| {
                    tally.add(of(position));
                    tally
                })
            })
        };
        let normalized = over(window(last), square).zip(over(window(last), |position| position.trace));
        Self {
            mean_rmse: Estimate::ratio(tracks.iter().map(|track| single(influence(track)))),
            middle_rmse: Estimate::ratio(over(last / 2..=last / 2, square)).sqrt(),
            window_rmse: Estimate::ratio(over(window(last), square)).sqrt(),
            middle_rapc: rapc.get(last / 2).copied().unwrap_or(f64::NAN),
            ratio: Estimate::ratio(normalized.map(|(e, p)| Tally { sum: e.sum, count: p.sum })).sqrt(),
            right: Estimate::ratio(runs.iter().map(|run| run.right)).scale(100.0),
            seconds: runs.iter().map(|run| run.seconds).sum::<f64>() / count,
            rmse,
            rapc,
        }
    }
}

fn square(position: &Position) -> f64 {
    position.error.norm_squared()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn fixed(errors: &[f64], trace: f64, right: f64) -> Fixed {
        let positions: Vec<Position> =
            errors.iter().map(|&error| Position { error: Vector3::new(0.0, error, 0.0), trace }).collect();
        Fixed { positions: [vec![], positions], right: Tally { sum: right, count: 4.0 }, wrong: vec![], seconds: 2.0 }
    }

    /// Two runs of three epochs by hand.
    #[test]
    fn numbers_are_those_of_their_definitions() {
        let runs = [fixed(&[3.0, 1.0, 0.0], 4.0, 4.0), fixed(&[4.0, 7.0, 0.0], 9.0, 3.0)];
        let outcome = Outcome::of(&runs.each_ref(), Posterior::Smoother);
        assert_eq!(outcome.rmse, [12.5_f64.sqrt(), 5.0, 0.0]);
        assert_eq!((outcome.rapc[0], outcome.middle_rapc), (6.5_f64.sqrt(), 6.5_f64.sqrt()));
        assert!((outcome.mean_rmse.value - (12.5_f64.sqrt() + 5.0) / 3.0).abs() < 1e-15);
        assert_eq!((outcome.middle_rmse.value, outcome.window_rmse.value), (5.0, 5.0));
        assert!((outcome.ratio.value - (50.0_f64 / 13.0).sqrt()).abs() < 1e-15);
        assert_eq!((outcome.right.value, outcome.seconds), (87.5, 2.0));
    }

    /// With equal runs nothing is uncertain; the influence of a run on TA-RMSE is then TA-RMSE.
    #[test]
    fn equal_runs_have_no_error() {
        let run = fixed(&[3.0, 1.0, 2.0], 4.0, 4.0);
        let outcome = Outcome::of(&[&run, &run, &run], Posterior::Smoother);
        for estimate in [outcome.mean_rmse, outcome.middle_rmse, outcome.window_rmse, outcome.ratio, outcome.right] {
            assert!(estimate.standard_error < 1e-12);
        }
        assert!((outcome.mean_rmse.value - 2.0).abs() < 1e-15);
    }

    #[test]
    fn the_window_is_two_hundred_epochs_of_a_thousand() {
        assert_eq!(window(1000), 400..=600);
        assert_eq!(window(0), 0..=0);
    }

    #[test]
    fn nothing_gives_not_a_number() {
        assert!(Outcome::of(&[], Posterior::Filter).mean_rmse.value.is_nan());
    }
}
