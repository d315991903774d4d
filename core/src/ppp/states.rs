//! Which state sits where in the density, and how states come, go and step through time.
//!
//! The first three states are the position error about the linearisation point `[m]`, the next three, of a moving receiver,
//! its velocity `[m/s]`. All others carry a label and may be anywhere (Zhang 2020, section 2.1):
//!
//! | label | unit | step over h seconds |
//! |---|---|---|
//! | [`Label::Clock`] | m | forgotten: Φ = 0 |
//! | [`Label::InterSystem`] | m | random walk |
//! | [`Label::Zenith`], [`Label::Gradient`] | m | random walk |
//! | [`Label::Ambiguity`] | m | random walk, by default constant |
//! | [`Label::Ionosphere`] | m | random walk |
//!
//! Panic contract: none. Cost of a step: O(n²) for the motion, O(n) else.

use super::config::{Motion, PppConfig};
use crate::filter::gaussian::{CapacityError, Gaussian};
use crate::gnss::satellite::{Constellation, SatelliteId};
use heapless::Vec;

/// What a state is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Label {
    /// Position error of an axis (ECEF).
    Position(u8),
    /// Velocity of an axis (ECEF).
    Velocity(u8),
    /// Receiver clock against the time of the reference constellation, c dt.
    Clock,
    /// Receiver clock against the time of this constellation less [`Label::Clock`].
    InterSystem(Constellation),
    /// Zenith wet delay.
    Zenith,
    /// Troposphere gradient, 0 to the north, 1 to the east.
    Gradient(u8),
    /// Ambiguity of a satellite: of the combination, or of one of its bands.
    Ambiguity(SatelliteId, u8),
    /// Slant delay of a satellite on its first band.
    Ionosphere(SatelliteId),
}

/// The density with its labels.
#[derive(Clone, Debug)]
pub struct States<const N: usize> {
    /// N(m, P).
    pub density: Gaussian<f64, N>,
    labels: Vec<Label, N>,
}

impl<const N: usize> Default for States<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> States<N> {
    /// No states yet.
    pub const fn new() -> Self {
        Self { density: Gaussian::new(), labels: Vec::new() }
    }

    /// Forgets all states.
    pub fn clear(&mut self) {
        self.density.clear();
        self.labels.clear();
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.labels.is_empty()
    }

    /// All labels, in order.
    pub fn labels(&self) -> &[Label] {
        &self.labels
    }

    /// Where a state is.
    pub fn index(&self, label: Label) -> Option<usize> {
        self.labels.iter().position(|&other| other == label)
    }

    /// Mean and variance of a state.
    pub fn marginal(&self, label: Label) -> Option<(f64, f64)> {
        let i = self.index(label)?;
        Some((self.density.mean().get(i).copied()?, self.density.covariance(i, i)))
    }

    /// Appends a state, or makes the one that is there independent of all others.
    pub fn bear(&mut self, label: Label, mean: f64, variance: f64) -> Result<usize, CapacityError> {
        if let Some(i) = self.index(label) {
            self.density.renew(i, mean, variance);
            return Ok(i);
        }
        let i = self.density.push(mean, variance)?;
        self.labels.push(label).map_err(|_| CapacityError)?;
        Ok(i)
    }

    /// Marginalises the states that are not to be kept.
    pub fn retain(&mut self, keep: impl Fn(Label) -> bool) {
        for i in (0..self.labels.len()).rev() {
            if self.labels.get(i).is_some_and(|&label| !keep(label)) {
                self.labels.remove(i);
                self.density.remove(i);
            }
        }
    }

    /// Number of motion states.
    pub fn order(config: &PppConfig) -> usize {
        match config.motion {
            Motion::Static => 1,
            Motion::Kinematic => 2,
        }
    }

    /// The density `h` seconds later; the clock is left to be born anew.
    pub fn predict(&mut self, h: f64, config: &PppConfig) {
        let process = &config.process;
        match config.motion {
            Motion::Static => {
                for axis in 0..3 {
                    self.density.inflate(axis, process.position * h);
                }
            }
            Motion::Kinematic => {
                let f = [[1.0, h, 0.0], [0.0, 1.0, 0.0], [0.0; 3]];
                let q = process.acceleration;
                let noise = [[q * h * h * h / 3.0, q * h * h / 2.0, 0.0], [q * h * h / 2.0, q * h, 0.0], [0.0; 3]];
                self.density.propagate(2, &f, &[noise; 3]);
            }
        }
        for (i, label) in self.labels.iter().enumerate() {
            let walk = match label {
                Label::Position(_) | Label::Velocity(_) | Label::Clock => continue,
                Label::InterSystem(_) => process.inter_system,
                Label::Zenith => process.zenith,
                Label::Gradient(_) => process.gradients,
                Label::Ambiguity(..) => process.ambiguity,
                Label::Ionosphere(_) => process.ionosphere,
            };
            self.density.inflate(i, walk * h);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_come_and_go_and_keep_their_labels() {
        let mut states = States::<4>::new();
        let ambiguity = |n| Label::Ambiguity(SatelliteId::new(Constellation::Gps, n).unwrap(), 0);
        for (i, label) in [Label::Clock, ambiguity(1), ambiguity(2)].into_iter().enumerate() {
            assert_eq!(states.bear(label, i as f64, 1.0 + i as f64), Ok(i));
        }
        states.retain(|label| label != ambiguity(1));
        assert_eq!(states.marginal(ambiguity(2)), Some((2.0, 3.0)));
        assert_eq!(states.index(ambiguity(1)), None);
        assert_eq!(states.bear(Label::Clock, 7.0, 9.0), Ok(0));
        assert_eq!((states.marginal(Label::Clock), states.density.dim()), (Some((7.0, 9.0)), 2));
        assert!(states.bear(ambiguity(3), 0.0, 1.0).is_ok() && states.bear(ambiguity(4), 0.0, 1.0).is_ok());
        assert_eq!(states.bear(ambiguity(5), 0.0, 1.0), Err(CapacityError));
    }

    #[test]
    fn walks_grow_with_time_and_a_moving_receiver_moves() {
        let mut states = States::<8>::new();
        for axis in 0..3 {
            states.bear(Label::Position(axis), 0.0, 0.0).unwrap();
        }
        for axis in 0..3 {
            states.bear(Label::Velocity(axis), 2.0, 0.0).unwrap();
        }
        states.bear(Label::Zenith, 0.1, 0.0).unwrap();
        let config = PppConfig { motion: Motion::Kinematic, ..PppConfig::DEFAULT };
        states.predict(30.0, &config);
        assert_eq!(states.density.mean()[..3], [60.0; 3]);
        assert!((states.density.covariance(0, 0) - 9000.0).abs() < 1e-9); // q h³/3, eq. (3)
        assert!((states.density.covariance(6, 6) - config.process.zenith * 30.0).abs() < 1e-18);
    }
}
