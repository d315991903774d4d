//! Where each state of the multi-band model is: x = (z; n_L1, n_L2, n_L5; I, İ, T, Ṫ [, dt, ḋt]).
//!
//! Cost: a few additions of integers, nothing is stored. Panic contract: none.

use super::combination::BANDS;
use core::ops::Range;

/// Numbers of the states; satellites and differences count from 0, difference i is satellite 0 minus satellite i + 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// N_s, the number of satellites.
    pub satellites: usize,
    /// Whether satellite clocks are states: in single differences.
    pub clocks: bool,
}

impl Layout {
    /// The nonlinear states z = (p^X, p^Y, p^Z, v^Z).
    pub const Z: Range<usize> = 0..4;
    /// p^Z.
    pub const UP: usize = 2;
    /// v^Z.
    pub const UP_RATE: usize = 3;

    /// N_s − 1, the number of differences.
    pub const fn differences(&self) -> usize {
        self.satellites.saturating_sub(1)
    }

    /// All ambiguities, band after band.
    pub const fn ambiguities(&self) -> Range<usize> {
        Self::Z.end..Self::Z.end + BANDS * self.differences()
    }

    /// Ambiguity of a band and a difference `[cycles]`.
    pub const fn ambiguity(&self, band: usize, difference: usize) -> usize {
        Self::Z.end + band * self.differences() + difference
    }

    /// Kinds of biases: ionosphere, troposphere, clock.
    pub const fn biases(&self) -> usize {
        if self.clocks { 3 } else { 2 }
    }

    /// Bias `kind` of a satellite `[m]`.
    pub(super) const fn bias(&self, kind: usize, satellite: usize) -> usize {
        self.ambiguities().end + 2 * kind * self.satellites + satellite
    }

    /// I of a satellite, on L1 `[m]`.
    pub const fn ionosphere(&self, satellite: usize) -> usize {
        self.bias(0, satellite)
    }

    /// T of a satellite `[m]`.
    pub const fn troposphere(&self, satellite: usize) -> usize {
        self.bias(1, satellite)
    }

    /// c·dt of a satellite `[m]`; beyond the states in double differences.
    pub const fn clock(&self, satellite: usize) -> usize {
        self.bias(2, satellite)
    }

    /// The rate of a bias state `[m/s]`.
    pub const fn rate_of_bias(&self, state: usize) -> usize {
        state + self.satellites
    }

    /// The state that is the rate of another, if there is one.
    pub const fn rate(&self, state: usize) -> Option<usize> {
        let biases = self.ambiguities().end;
        if state == Self::UP {
            Some(Self::UP_RATE)
        } else if state >= biases && state < self.states() && ((state - biases) / self.satellites).is_multiple_of(2) {
            Some(self.rate_of_bias(state))
        } else {
            None
        }
    }

    /// Number of states: 71 for ten satellites in double differences, 91 in single ones.
    pub const fn states(&self) -> usize {
        self.bias(self.biases(), 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dimensions_are_those_of_the_paper() {
        assert_eq!(Layout { satellites: 10, clocks: false }.states(), 71);
        assert_eq!(Layout { satellites: 10, clocks: true }.states(), 91);
        assert_eq!(Layout { satellites: 0, clocks: true }.states(), 4);
    }

    #[test]
    fn every_state_is_found_once() {
        let layout = Layout { satellites: 4, clocks: true };
        let mut count = vec![0; layout.states()];
        let mut see = |state: usize| count[state] += 1;
        Layout::Z.for_each(&mut see);
        for band in 0..BANDS {
            (0..3).for_each(|i| see(layout.ambiguity(band, i)));
        }
        for s in 0..4 {
            for bias in [layout.ionosphere(s), layout.troposphere(s), layout.clock(s)] {
                see(bias);
                see(layout.rate(bias).unwrap());
                assert_eq!(layout.rate(layout.rate_of_bias(bias)), None);
            }
        }
        assert!(count.iter().all(|&n| n == 1));
        assert_eq!((layout.rate(0), layout.rate(2), layout.rate(3)), (None, Some(3), None));
        assert_eq!((layout.rate(5), layout.rate(usize::MAX)), (None, None));
    }
}
