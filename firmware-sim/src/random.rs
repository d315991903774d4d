//! Random numbers that are the same on every machine. This file needs nothing but `libm`: tests on the host include it too.

/// Independent numbers from a linear congruential generator (D. E. Knuth, MMIX).
#[derive(Clone, Copy, Debug)]
pub struct Noise(u64);

impl Noise {
    /// From a seed.
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Between −½ and ½.
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        f64::from((self.0 >> 32) as u32) / f64::from(u32::MAX) - 0.5
    }

    /// About normal, with a variance of 1: the sum of twelve.
    pub fn normal(&mut self) -> f64 {
        (0..12).fold(0.0, |sum, _| sum + self.uniform())
    }

    /// A whole number of cycles between −10 and 10.
    pub fn cycles(&mut self) -> f64 {
        libm::round(20.0 * self.uniform())
    }
}
