//! How the states move: random walks of p^X and p^Y, random walks of the velocity for p^Z and every bias, and a random walk
//! of the ambiguities whose variance rises where a slip was detected.
//!
//! ```text
//! Q⁻¹ = M⁽⁰⁾ + Σ_j M⁽ʲ⁾ θ_j,   θ_j = 1/σ_j²                                       (11), (15), (16)
//! p^X, p^Y:      σ² h                       p^Z, biases:  σ² [h³/3 h²/2; h²/2 h]   (14)
//! ambiguities:   σ_L², or σ_H² if flagged, an epoch                               (20)
//! ```
//! n_k^j, the scalars that component j has in Q: 1, 1, 2, and 2 N_s for each kind of bias.
//!
//! Cost: one call for each entry of F or block of Q, linear in the number of states. Panic contract: none.

use super::{Layout, MultiBandModel};
use crate::model::motion::Motion;
use crate::smooth::step::{BLOCK, Block};

/// A component of the process noise; the parameter of its variance. Its number is `self as usize`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Component {
    /// p^X `[m²/s]`.
    X,
    /// p^Y `[m²/s]`.
    Y,
    /// v^Z `[m²/s³]`.
    Z,
    /// İ `[m²/s³]`.
    Ionosphere,
    /// Ṫ `[m²/s³]`.
    Troposphere,
    /// ḋt `[m²/s³]`, in single differences.
    Clock,
}

impl Component {
    /// In the order of θ.
    pub const ALL: [Self; 6] = [Self::X, Self::Y, Self::Z, Self::Ionosphere, Self::Troposphere, Self::Clock];
}

/// The numbers of the motion. The default is Appendix A with the decided ambiguity noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionParameters {
    /// h `[s]`.
    pub interval: f64,
    /// σ² = 1/θ of each [`Component`].
    pub variances: [f64; Component::ALL.len()],
    /// σ_L² `[cycles²]`, an epoch.
    pub stay: f64,
    /// σ_H² `[cycles²]`, over a slip.
    pub slip: f64,
}

impl Default for MotionParameters {
    fn default() -> Self {
        let (walk, velocity) = (0.01 * 0.01, 0.001 * 0.001);
        Self {
            interval: 5.0,
            variances: [walk, walk, velocity, velocity, velocity, velocity],
            stay: 0.05 * 0.05,
            slip: 10.0 * 10.0,
        }
    }
}

impl MultiBandModel<'_> {
    /// Calls `entry` with row, column and value of each entry of A.
    pub fn transition(&self, interval: f64, entry: &mut dyn FnMut(usize, usize, f64)) {
        let layout = self.layout();
        for state in 0..layout.states() {
            entry(state, state, 1.0);
            if let Some(rate) = layout.rate(state) {
                entry(state, rate, interval);
            }
        }
    }

    /// Calls `block` with each block of Q. `slipped` says of each ambiguity, numbered from 0, whether it is flagged.
    pub fn process_noise(
        &self,
        parameters: &MotionParameters,
        slipped: impl Fn(usize) -> bool,
        block: &mut dyn FnMut(Block<f64>),
    ) {
        let layout = self.layout();
        let scale = |component: Component| parameters.variances.get(component as usize).copied().unwrap_or_default();
        let single = |state: usize, variance: f64, scale: f64, component: Option<usize>| Block {
            states: [state, 0, 0],
            dim: 1,
            shape: [[variance, 0.0, 0.0], [0.0; BLOCK], [0.0; BLOCK]],
            scale,
            component,
        };
        let velocity = |state: usize, rate: usize, component: Component| Block {
            states: [state, rate, 0],
            dim: 2,
            shape: Motion::Velocity.process_noise(parameters.interval, 1.0),
            scale: scale(component),
            component: Some(component as usize),
        };
        for (state, component) in [Component::X, Component::Y].into_iter().enumerate() {
            block(single(state, parameters.interval, scale(component), Some(component as usize)));
        }
        block(velocity(Layout::UP, Layout::UP_RATE, Component::Z));
        for (i, state) in layout.ambiguities().enumerate() {
            block(single(state, 1.0, if slipped(i) { parameters.slip } else { parameters.stay }, None));
        }
        let biases = [Component::Ionosphere, Component::Troposphere, Component::Clock];
        for (kind, component) in biases.into_iter().take(layout.biases()).enumerate() {
            for satellite in 0..layout.satellites {
                let state = layout.bias(kind, satellite);
                block(velocity(state, layout.rate_of_bias(state), component));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::model;
    use super::*;
    use nalgebra::Matrix2;

    /// Blocks are disjoint, cover all states, and have n_k^j scalars a component.
    #[test]
    fn blocks_cover_each_state_once() {
        let model = model(None);
        let mut covered = vec![0; model.layout().states()];
        let mut count = [0; 7];
        model.process_noise(&MotionParameters::default(), |i| i == 2, &mut |block| {
            block.states[..block.dim].iter().for_each(|&state| covered[state] += 1);
            count[block.component.unwrap_or(6)] += block.dim;
            let slip = block.states[0] == model.layout().ambiguity(0, 2);
            assert!(block.component.is_some() || block.scale == if slip { 100.0 } else { 0.05 * 0.05 });
        });
        assert!(covered.iter().all(|&n| n == 1));
        assert_eq!(count, [1, 1, 2, 8, 8, 8, 9]);
    }

    /// The shape is the inverse of M^CV of (14).
    #[test]
    fn velocity_block_is_the_inverse_of_the_papers_basis() {
        let h: f64 = 5.0;
        let basis = 12.0 / h.powi(3) * Matrix2::new(1.0, -h / 2.0, -h / 2.0, h * h / 3.0);
        let model = model(None);
        model.process_noise(&MotionParameters::default(), |_| false, &mut |block| {
            if block.dim == 2 {
                let shape = Matrix2::from_fn(|i, j| block.shape[i][j]);
                assert!((shape * basis - Matrix2::identity()).amax() < 1e-12);
            }
        });
    }

    #[test]
    fn each_rate_moves_its_state() {
        let model = model(None);
        let mut entries = vec![];
        model.transition(5.0, &mut |i, j, value| entries.push((i, j, value)));
        assert_eq!(entries.len(), model.layout().states() + 1 + 3 * 4);
        assert!(entries.contains(&(2, 3, 5.0)) && entries.contains(&(3, 3, 1.0)));
        let clock = model.layout().clock(3);
        assert!(entries.contains(&(clock, clock + 4, 5.0)));
    }
}
