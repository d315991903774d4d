//! Three bands of code, phase and Doppler in double or single differences, with ionosphere, troposphere and satellite
//! clocks as states that virtual measurements see: the DD-IF and SD-IF models of Greiff et al., *Adaptive Smoothing with
//! Ambiguity Fixation for GNSS Post-Processing* (2023), section 3 and Appendix A.
//!
//! ```text
//! x = (p^X, p^Y, p^Z, v^Z;  n_L1, n_L2, n_L5;  I, İ, T, Ṫ [, dt, ḋt])                      → [`Layout`]
//! P_b = M(ρ + r_b I + T [− dt]) + ε
//! Φ_b = M(ρ − r_b I + T [− dt]) + λ_b n_b + ε          r_b = f₁²/f_b²
//! Γ_b = M(−ρ̇ + r_b İ − Ṫ [+ ḋt]) + ε                                                       → [`rows`]
//! ```
//! M = [1 −I] differences satellite 1 against the others; in double differences (a base is given) ρ, I and T are rover minus
//! base and the noise counts twice (f = 2), in single differences (no base) there are clocks and f = 1. Noise of a kind of
//! signal: f σ² M Mᵀ, independent between bands and kinds. Everything is linear but ρ(p) and ρ̇(p, v) ([`range`]).
//!
//! **Combinations of bands.** The paper's rows are L1 itself and two ionosphere-free combinations g₁ − α_d g_d, α_d = 1/r_d,
//! that is the rows of B = [1 0 0; 1 −α₂ 0; 1 0 −α₅] applied to the bands; their noise is B Bᵀ ⊗ diag(σ²) ⊗ f M Mᵀ. B is
//! invertible, hence nothing is lost or gained against the bands themselves, whose noise is block diagonal:
//! ln p(B y) = ln p(y) − ln |det B|. Any [`Combination`] of the bands has its rows here. Geometry, troposphere and clock are
//! scaled by 1 − α_d in the paper's combinations, which have no denominator; the integers stay those of the bands.
//!
//! Departures from the paper's letter, all needed: λ = c/f; velocity of the rover is (0, 0, v^Z); the reciprocal of its α
//! would not cancel I; *all* satellite clocks are measured by default, because with the first alone the position is
//! unobservable (RAPC tens of metres).
//!
//! Units: metres, clocks as c·dt `[m]`, rates `[m/s]`, ambiguities `[cycles]`, Doppler as a range rate `[m/s]` of opposite
//! sign. Axes: any fixed ones; positions and velocities are relative to one fixed point near the rover.
//! Panic contract of all parts: none.

mod combination;
mod layout;
mod motion;
mod range;
mod rows;
mod slip;

pub use combination::{BANDS, Bands, Combination};
pub use layout::Layout;
pub use motion::{Component, MotionParameters};
pub use rows::Signal;
pub use slip::ambiguity_innovation;

use nalgebra::Vector3;

/// A satellite relative to the linearisation point, in its axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Satellite {
    /// Position `[m]`.
    pub position: Vector3<f64>,
    /// Velocity `[m/s]`.
    pub velocity: Vector3<f64>,
}

/// Which satellite clocks a virtual measurement sees.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ClockRows {
    /// Each of them.
    #[default]
    All,
    /// Only that of satellite 1, as the paper has it: the position is not observable then.
    First,
}

/// Variances of the measurements, of undifferenced signals `[m²]`, Doppler `[m²/s²]`. The default is Appendix A.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variances {
    /// Code.
    pub code: f64,
    /// Phase.
    pub phase: f64,
    /// Doppler.
    pub doppler: f64,
    /// Virtual measurements of the ionosphere on L1.
    pub ionosphere: f64,
    /// Virtual measurements of the troposphere.
    pub troposphere: f64,
    /// Virtual measurements of satellite clocks.
    pub clock: f64,
}

impl Default for Variances {
    fn default() -> Self {
        let square = |sigma: f64| sigma * sigma;
        Self {
            code: square(0.5),
            phase: square(0.01),
            doppler: square(0.05),
            ionosphere: square(0.01),
            troposphere: square(0.01),
            clock: square(0.001),
        }
    }
}

/// The model at one epoch.
#[derive(Clone, Copy, Debug)]
pub struct MultiBandModel<'a> {
    /// The satellites, the positive one of all differences first.
    pub satellites: &'a [Satellite],
    /// The base station relative to the linearisation point `[m]`; without one, differences are single.
    pub base: Option<Vector3<f64>>,
    /// The bands.
    pub bands: Bands,
    /// Noise of the measurements.
    pub variances: Variances,
    /// Which clocks are measured.
    pub clock_rows: ClockRows,
}

impl MultiBandModel<'_> {
    /// Where each state is.
    pub fn layout(&self) -> Layout {
        Layout { satellites: self.satellites.len(), clocks: self.base.is_none() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four satellites somewhere in the sky.
    pub(super) const SATELLITES: [Satellite; 4] = [
        at([-5.56e6, 3.55e6, 19.36e6], [1892.0, -2110.0, 700.0]),
        at([-5.83e6, -3.14e6, 19.35e6], [2528.0, 883.0, 680.0]),
        at([9.75e6, 10.5e6, 15.99e6], [107.0, -2816.0, 1276.0]),
        at([14.42e6, -2.49e6, 15.79e6], [-105.0, -2869.0, -253.0]),
    ];

    const fn at([x, y, z]: [f64; 3], [vx, vy, vz]: [f64; 3]) -> Satellite {
        Satellite { position: Vector3::new(x, y, z), velocity: Vector3::new(vx, vy, vz) }
    }

    /// A model of these satellites with the paper's numbers.
    pub(super) fn model(base: Option<Vector3<f64>>) -> MultiBandModel<'static> {
        MultiBandModel {
            satellites: &SATELLITES,
            base,
            bands: Bands::new([1575.42e6, 1227.6e6, 1176e6]).unwrap(),
            variances: Variances::default(),
            clock_rows: ClockRows::All,
        }
    }

    #[test]
    fn clocks_are_states_of_single_differences() {
        assert!(model(None).layout().clocks && !model(Some(Vector3::zeros())).layout().clocks);
    }
}
