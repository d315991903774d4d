//! Where the states of the multi-band model are at an epoch whose ambiguities are fixed in part.
//!
//! Cost: two numbers a state; a place is found in one step. Panic contract: none.

use surefix_core::model::multi_band::Layout;

/// A state that is fixed has this place.
const GONE: usize = usize::MAX;

/// Numbers of the states that are left, in the order of the model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Places {
    place: Vec<usize>,
    left: Vec<usize>,
}

impl Places {
    /// All states but the ambiguities for which `fixed` is true; they are numbered from 0.
    pub fn new(layout: &Layout, fixed: impl Fn(usize) -> bool) -> Self {
        let ambiguities = layout.ambiguities();
        let gone = |state: usize| ambiguities.contains(&state) && fixed(state - ambiguities.start);
        let left: Vec<usize> = (0..layout.states()).filter(|&state| !gone(state)).collect();
        let mut place = vec![GONE; layout.states()];
        for (number, &state) in left.iter().enumerate() {
            place[state] = number;
        }
        Self { place, left }
    }

    /// Number of states left.
    pub fn count(&self) -> usize {
        self.left.len()
    }

    /// States that are left, by their numbers in the whole model.
    pub fn left(&self) -> &[usize] {
        &self.left
    }

    /// Place of a state of the whole model; `None` if it is fixed.
    pub fn of(&self, state: usize) -> Option<usize> {
        self.place.get(state).copied().filter(|&place| place != GONE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fixed_ambiguities_leave_no_gap() {
        let layout = Layout { satellites: 3, clocks: false };
        let places = Places::new(&layout, |i| i == 0 || i == 4);
        assert_eq!(places.count(), layout.states() - 2);
        assert_eq!((places.of(3), places.of(4), places.of(5), places.of(8)), (Some(3), None, Some(4), None));
        assert_eq!((places.of(9), places.of(99), places.left()[7]), (Some(7), None, 9));
    }
}
