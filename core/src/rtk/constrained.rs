//! The constrained density that lives on: position and velocity given all integers accepted so far (Greiff 2021,
//! Algorithm 1, eq. 38), for [`Output::DualDensity`](crate::filter::mixed_integer::Output).
//!
//! It begins as the marginal of the predicted relaxed density, is predicted like it, and is updated with Doppler, codes
//! and those phases whose ambiguity was accepted in this epoch, z = y − G nᴵ. An epoch without accepted integers ends it,
//! and so does an integer that turns out to be another one than was believed: its covariance would never tell.
//!
//! Panic contract: none.

use super::channel::Channels;
use super::link::Link;
use super::rows::KinematicRow;
use super::{GROUPS, rows};
use crate::filter::common_term::CommonTerm;
use crate::filter::gaussian::{Gaussian, UpdateWork};
use crate::filter::update::Form;
use nalgebra::Vector3;

/// Most kinematic states.
pub(super) const KINEMATIC: usize = 9;

/// N(x | z) and what it begins with.
pub(super) struct Constrained {
    /// Where the mean's first three states are errors of.
    position: Vector3<f64>,
    density: Gaussian<f64, KINEMATIC>,
    /// The predicted relaxed density of this epoch, about the position where the links were computed.
    prior: Gaussian<f64, KINEMATIC>,
    prior_position: Vector3<f64>,
    common: CommonTerm<f64, KINEMATIC>,
    work: UpdateWork<f64, KINEMATIC>,
}

impl Constrained {
    pub const fn new() -> Self {
        Self {
            position: Vector3::new(0.0, 0.0, 0.0),
            density: Gaussian::new(),
            prior: Gaussian::new(),
            prior_position: Vector3::new(0.0, 0.0, 0.0),
            common: CommonTerm::new(),
            work: UpdateWork::new(),
        }
    }

    /// Moves with a base that was found elsewhere.
    pub fn shift(&mut self, by: Vector3<f64>) {
        self.position += by;
    }

    /// Forgets what was constrained.
    pub fn end(&mut self) {
        self.density.clear();
    }

    /// Prediction, as of the relaxed density.
    pub fn propagate(&mut self, order: usize, f: &[[f64; 3]; 3], noise: &[[f64; 3]; 3]) {
        self.density.propagate(order, f, &[*noise; 3]);
    }

    /// Takes the predicted relaxed density of `states` kinematic states as the one to begin with.
    pub fn prepare<const N: usize>(&mut self, relaxed: &Gaussian<f64, N>, position: Vector3<f64>, states: usize) {
        self.prior.marginal_of(relaxed, states);
        self.prior_position = position;
        if self.density.dim() != self.prior.dim() {
            self.density.clear();
        }
    }

    /// Updates with the observations of an epoch, of whose channels those with a fixed ambiguity take part with their
    /// phase. The density is then that of z up to this epoch, about [`Constrained::position`]; none if it cannot take them.
    pub fn update<const C: usize>(
        &mut self,
        form: Form,
        links: &[Link],
        channels: &Channels<C>,
    ) -> Option<&Gaussian<f64, KINEMATIC>> {
        if self.density.dim() == 0 {
            self.density.clone_from(&self.prior);
            self.position = self.prior_position;
        }
        // Rows are about the position where the links were computed.
        let apart = self.position - self.prior_position;
        for (mean, shift) in self.density.mean_mut().iter_mut().zip(apart.iter()) {
            *mean += shift;
        }
        self.position = self.prior_position;
        let Self { density, common, work, .. } = self;
        let with_velocity = density.dim() > 3;
        let n = density.dim();
        let outcome = density.update(form, work, |stage, mean| {
            let mut take = |common: &mut CommonTerm<f64, KINEMATIC>, row: KinematicRow| {
                let difference = common.difference(n, &row.entries, row.value, row.variance);
                difference.map_or(Ok(()), |difference| difference.update(stage, mean))
            };
            common.reset();
            for row in rows::doppler(links).filter(|_| with_velocity) {
                take(common, row)?;
            }
            for group in 0..GROUPS {
                common.reset();
                for (row, channel) in rows::phase(links, channels.as_slice(), group) {
                    let Some(n) = channel.fixed else { continue };
                    take(common, KinematicRow { value: row.value + channel.unit() * n, ..row })?;
                }
                common.reset();
                for row in rows::code(links, group) {
                    take(common, row)?;
                }
            }
            Ok(())
        });
        for (mean, position) in self.density.mean_mut().iter_mut().zip(self.position.iter_mut()) {
            *position += *mean;
            *mean = 0.0;
        }
        outcome.is_ok().then_some(&self.density)
    }

    /// Where the constrained density is.
    pub fn position(&self) -> Vector3<f64> {
        self.position
    }
}
