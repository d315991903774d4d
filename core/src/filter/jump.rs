//! The integer jump process 𝒥(a, b): what cycle slips are taken to be.
//!
//! With probability b an ambiguity jumps, by an integer uniform on [−a, a] without 0:
//! ```text
//! 𝒥(s | a, b) = 1 − b  for s = 0,   b/2a  for 0 < |s| ≤ a,   0 beyond            (27)
//! E s = 0,   E s² = b (a + 1)(2a + 1)/6
//! ```
//! Greiff et al. (CCTA 2021), eqs. (27)–(29). Ambiguities jump independently; over an interval h the probability is b h with
//! b in jumps per second. The standard deviation of a jump that happens is √((a + 1)(2a + 1)/6), 6.2 cycles for a = 10.
//!
//! Panic contract: none.

/// 𝒥(a, b).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JumpProcess {
    /// a, the largest jump `[cycles]`; 0 for none.
    pub largest: u32,
    /// b, the probability of a jump per step, 0 to 1.
    pub probability: f64,
}

impl JumpProcess {
    /// Probability mass at `jump`.
    pub fn mass(&self, jump: i64) -> f64 {
        if self.largest == 0 {
            return f64::from(u8::from(jump == 0));
        }
        match jump.unsigned_abs() {
            0 => 1.0 - self.probability,
            size if size <= u64::from(self.largest) => self.probability / (2.0 * f64::from(self.largest)),
            _ => 0.0,
        }
    }

    /// Mean, 0 by symmetry `[cycles]`.
    pub fn mean(&self) -> f64 {
        0.0
    }

    /// Variance of a step `[cycles²]`.
    pub fn variance(&self) -> f64 {
        self.probability * self.variance_of_a_jump()
    }

    /// Variance of a step that is a jump `[cycles²]`: what σ_jump² stands for.
    pub fn variance_of_a_jump(&self) -> f64 {
        if self.largest == 0 {
            return 0.0;
        }
        let a = f64::from(self.largest);
        (a + 1.0) * (2.0 * a + 1.0) / 6.0
    }

    /// The jump that a uniform number in [0, 1) stands for, by inversion: below b it is one of the 2a jumps in equal parts.
    pub fn from_uniform(&self, uniform: f64) -> i64 {
        if !(uniform >= 0.0 && uniform < self.probability) || self.largest == 0 {
            return 0;
        }
        let a = i64::from(self.largest);
        let index =
            (libm::floor(uniform / self.probability * 2.0 * f64::from(self.largest)) as i64).clamp(0, 2 * a - 1);
        if index < a { index - a } else { index - a + 1 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Moments by summing the mass.
    #[test]
    fn moments_are_those_of_the_mass() {
        for (largest, probability) in [(0, 0.3), (1, 0.5), (3, 0.2), (10, 0.005)] {
            let process = JumpProcess { largest, probability };
            let sum = |f: fn(f64) -> f64| (-12..=12).map(|s| process.mass(s) * f(s as f64)).sum::<f64>();
            assert!((sum(|_| 1.0) - 1.0).abs() < 1e-14);
            assert!((sum(|s| s) - process.mean()).abs() < 1e-14);
            assert!((sum(|s| s * s) - process.variance()).abs() < 1e-14);
        }
    }

    #[test]
    fn inversion_has_the_right_shares() {
        let process = JumpProcess { largest: 3, probability: 0.6 };
        let mut counts = [0; 7];
        for i in 0..1000 {
            counts[(process.from_uniform((f64::from(i) + 0.5) / 1000.0) + 3) as usize] += 1;
        }
        assert_eq!(counts, [100, 100, 100, 400, 100, 100, 100]);
        for uniform in [f64::NAN, -1.0, 1.0, 2.0] {
            assert_eq!(process.from_uniform(uniform), 0);
        }
        let edge = JumpProcess { largest: 3, probability: 1.0 };
        assert_eq!((edge.from_uniform(0.0), edge.from_uniform(1.0 - f64::EPSILON / 2.0)), (-3, 3));
    }
}
