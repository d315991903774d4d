//! How much of R* is replaced in an epoch.
//!
//! ```text
//! Sage–Husa   d_k = (1 − b)/(1 − b^(k+1)),  k = 0, 1, …:  1, then down to 1 − b
//! IAVAKF      1/β_k = Σ_{i<k} P_sⁱ + P_sᵏ/β₀,  that is β_k = β_{k−1}/(β_{k−1} + P_s):  down to 1 − P_s
//! ```
//! L. Wang et al. (2022), eq. (24), in force while the success rate P_s exceeds a threshold; else Sage–Husa (eq. 26). Both
//! are the same recursion, with b for P_s, so that one number is kept. At P_s = 1 nothing would be forgotten and
//! nothing learned: β is kept within bounds.
//!
//! Cost: one division. No panics.

/// What β follows.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Forgetting {
    /// Sage–Husa with the forgetting factor b, above 0 and below 1 (0.95 to 0.99 in use).
    SageHusa {
        /// b.
        b: f64,
    },
    /// By the success rate of the integers.
    SuccessRate {
        /// P_s above which it counts (0.95).
        threshold: f64,
        /// b where it does not.
        b: f64,
        /// Least and largest β; 0 and 1 for the formula as printed.
        bounds: [f64; 2],
    },
}

impl Default for Forgetting {
    fn default() -> Self {
        Self::SageHusa { b: 0.97 }
    }
}

impl Forgetting {
    /// That of the paper, kept within [0.01, 0.05].
    pub const IAVAKF: Self = Self::SuccessRate { threshold: 0.95, b: 0.97, bounds: [0.01, 0.05] };

    /// Whether the numbers make sense: probabilities, bounds in order.
    pub fn is_sound(&self) -> bool {
        let fraction = |x: f64| x > 0.0 && x < 1.0;
        match *self {
            Self::SageHusa { b } => fraction(b),
            Self::SuccessRate { threshold, b, bounds: [low, high] } => {
                fraction(threshold) && fraction(b) && low >= 0.0 && low <= high && high <= 1.0
            }
        }
    }
}

/// β of the latest epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beta(f64);

impl Beta {
    /// β₀: after a start all is replaced by what the first epoch says (1), or less of it.
    pub const fn new(beta: f64) -> Self {
        Self(beta)
    }

    /// The latest.
    pub const fn get(self) -> f64 {
        self.0
    }

    /// β of the next epoch, of integers with the success rate `success`. One that is not a probability counts as none.
    pub fn next(&mut self, forgetting: &Forgetting, success: f64) -> f64 {
        let (keep, [low, high]) = match *forgetting {
            Forgetting::SageHusa { b } => (b, [0.0, 1.0]),
            Forgetting::SuccessRate { threshold, b, bounds } => {
                if success > threshold && success <= 1.0 {
                    (success, bounds)
                } else {
                    (b, [0.0, 1.0])
                }
            }
        };
        let beta = self.0 / (self.0 + keep);
        self.0 = beta;
        // The recursion itself is not bounded, only what is used of it.
        beta.max(low).min(high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// b = 0.95: d = 1, 1/1.95, 1/(1 + 0.95 · 1.95), … by hand.
    #[test]
    fn sage_husa_by_hand() {
        let mut beta = Beta::new(1.0);
        let forgetting = Forgetting::SageHusa { b: 0.95 };
        assert!((beta.next(&forgetting, f64::NAN) - 1.0 / 1.95).abs() < 1e-15);
        assert!((beta.next(&forgetting, 0.3) - 1.0 / (1.0 + 0.95 * 1.95)).abs() < 1e-15);
    }

    #[test]
    fn the_success_rate_counts_above_its_threshold_only() {
        let literal = Forgetting::SuccessRate { threshold: 0.95, b: 0.9, bounds: [0.0, 1.0] };
        let after = |forgetting: Forgetting, success| {
            let mut beta = Beta::new(1.0);
            (0..2000).map(|_| beta.next(&forgetting, success)).last().unwrap()
        };
        assert!((after(literal, 0.96) - 0.04).abs() < 1e-12);
        assert!((after(literal, 0.95) - 0.1).abs() < 1e-12, "not above");
        assert!((after(literal, f64::NAN) - 0.1).abs() < 1e-12);
        // P_s = 1: 1/(k + 1/β₀).
        assert!((after(literal, 1.0) - 1.0 / 2001.0).abs() < 1e-15);
        assert_eq!(after(Forgetting::IAVAKF, 1.0), 0.01);
        assert!(Forgetting::IAVAKF.is_sound() && Forgetting::default().is_sound());
        for bad in [Forgetting::SageHusa { b: 1.0 }, Forgetting::SageHusa { b: f64::NAN }] {
            assert!(!bad.is_sound());
        }
        assert!(!Forgetting::SuccessRate { threshold: 0.9, b: 0.9, bounds: [0.5, 0.1] }.is_sound());
    }

    proptest! {
        /// The recursion is the sum.
        #[test]
        fn the_recursion_is_the_sum(p in 0.951..1.0, start in 0.01..1.0, k in 1usize..300) {
            let literal = Forgetting::SuccessRate { threshold: 0.95, b: 0.9, bounds: [0.0, 1.0] };
            let mut beta = Beta::new(start);
            let last = (0..k).map(|_| beta.next(&literal, p)).last().unwrap();
            let sum: f64 = (0..k as i32).map(|i| p.powi(i)).sum::<f64>() + p.powi(k as i32) / start;
            prop_assert!((last * sum - 1.0).abs() < 1e-12);
        }
    }
}
