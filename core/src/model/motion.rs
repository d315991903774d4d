//! Motion models: how position, velocity and acceleration evolve between epochs.
//!
//! White-noise models (Bar-Shalom, Li, Kirubarajan 2001, eqs. 6.2.2-4 and 6.2.3-7): the highest derivative is driven by
//! continuous white noise of power spectral density `q`. Per axis, with the state (p, v) or (p, v, a):
//!
//! ```text
//! order 2:  F = [1 h; 0 1]               Q = q [h³/3 h²/2; h²/2 h]
//! order 3:  F = [1 h h²/2; 0 1 h; 0 0 1] Q = q [h⁵/20 h⁴/8 h³/6; h⁴/8 h³/3 h²/2; h³/6 h²/2 h]
//! ```
//!
//! The full state stacks three axes by derivative: (p₁ p₂ p₃, v₁ v₂ v₃, a₁ a₂ a₃), ECEF, metres and seconds.
//! Panic contract: none.

/// How a receiver moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum Motion {
    /// It does not move: three position states without process noise.
    Static,
    /// Position and velocity, driven by white acceleration.
    Velocity,
    /// Position, velocity and acceleration, driven by white jerk.
    Acceleration,
}

impl Motion {
    /// Number of states per axis: 1, 2 or 3.
    pub const fn order(self) -> usize {
        match self {
            Self::Static => 1,
            Self::Velocity => 2,
            Self::Acceleration => 3,
        }
    }

    /// Number of states for three axes: 3, 6 or 9.
    pub const fn states(self) -> usize {
        3 * self.order()
    }

    /// Transition F (upper triangle, `f[i][j]` maps derivative j into i) over `h` `[s]`; entries beyond the order are 0.
    pub fn transition(self, h: f64) -> [[f64; 3]; 3] {
        match self {
            Self::Static => [[1.0, 0.0, 0.0], [0.0; 3], [0.0; 3]],
            Self::Velocity => [[1.0, h, 0.0], [0.0, 1.0, 0.0], [0.0; 3]],
            Self::Acceleration => [[1.0, h, 0.5 * h * h], [0.0, 1.0, h], [0.0, 0.0, 1.0]],
        }
    }

    /// Process noise Q of one axis over `h` `[s]` for the density `q` (`[m²/s³]` for order 2, `[m²/s⁵]` for order 3);
    /// zero for [`Motion::Static`].
    pub fn process_noise(self, h: f64, q: f64) -> [[f64; 3]; 3] {
        let (h2, h3) = (h * h, h * h * h);
        match self {
            Self::Static => [[0.0; 3]; 3],
            Self::Velocity => [[q * h3 / 3.0, q * h2 / 2.0, 0.0], [q * h2 / 2.0, q * h, 0.0], [0.0; 3]],
            Self::Acceleration => [
                [q * h3 * h2 / 20.0, q * h2 * h2 / 8.0, q * h3 / 6.0],
                [q * h2 * h2 / 8.0, q * h3 / 3.0, q * h2 / 2.0],
                [q * h3 / 6.0, q * h2 / 2.0, q * h],
            ],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// F(a+b) = F(b) F(a) and Q(a+b) = F(b) Q(a) F(b)ᵀ + Q(b): the discrete model belongs to one continuous process.
    #[test]
    fn two_steps_equal_one() {
        for motion in [Motion::Velocity, Motion::Acceleration] {
            let (a, b, q) = (0.7, 1.9, 3.0);
            let (fb, fa, fab) = (motion.transition(b), motion.transition(a), motion.transition(a + b));
            let (qa, qb, qab) =
                (motion.process_noise(a, q), motion.process_noise(b, q), motion.process_noise(a + b, q));
            for i in 0..motion.order() {
                for j in 0..motion.order() {
                    let f: f64 = (0..3).map(|k| fb[i][k] * fa[k][j]).sum();
                    let cov: f64 = (0..9).map(|kl| fb[i][kl / 3] * qa[kl / 3][kl % 3] * fb[j][kl % 3]).sum();
                    assert!((f - fab[i][j]).abs() < 1e-12 && (cov + qb[i][j] - qab[i][j]).abs() < 1e-10);
                }
            }
        }
    }
}
