//! Whether innovations agree with their covariance, over the last epochs.
//!
//! ν ~ N(0, S) makes νᵀ S⁻¹ ν of m measurements χ² with m degrees of freedom (NIS, Bar-Shalom, Li & Kirubarajan,
//! *Estimation with Applications to Tracking and Navigation*, 2001, sec. 5.4). Where the sum over a window exceeds its
//! degrees of freedom, the covariance is too small by their ratio, and protection levels are widened by its root. (They
//! are never narrowed.)
//!
//! Cost: a few operations for an epoch, 16 bytes for each epoch of the window. No panics.

/// Normalised innovations of the last `N` epochs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NisWindow<const N: usize> {
    epochs: [(f64, f64); N],
    next: usize,
    len: usize,
}

impl<const N: usize> Default for NisWindow<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> NisWindow<N> {
    /// No epochs yet.
    pub const fn new() -> Self {
        Self { epochs: [(0.0, 0.0); N], next: 0, len: 0 }
    }

    /// Takes an epoch's νᵀ S⁻¹ ν and its number of measurements; one without measurements, or with a sum that is not
    /// finite and positive, is left out and returns false.
    pub fn push(&mut self, squares: f64, measurements: usize) -> bool {
        if measurements == 0 || !(squares.is_finite() && squares >= 0.0) {
            return false;
        }
        let Some(place) = self.epochs.get_mut(self.next) else { return false };
        *place = (squares, measurements as f64);
        self.next = if self.next + 1 < N { self.next + 1 } else { 0 };
        self.len = (self.len + 1).min(N);
        true
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        *self = Self::new();
    }

    /// Number of epochs in it.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Σ νᵀ S⁻¹ ν and Σ m over the window.
    pub fn sums(&self) -> (f64, f64) {
        self.epochs
            .iter()
            .take(self.len)
            .fold((0.0, 0.0), |(squares, count), epoch| (squares + epoch.0, count + epoch.1))
    }

    /// By what standard deviations have to be multiplied: √(Σ νᵀ S⁻¹ ν/Σ m), at least 1.
    pub fn inflation(&self) -> f64 {
        let (squares, count) = self.sums();
        if squares > count && count > 0.0 { libm::sqrt(squares / count) } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_epochs_count() {
        let mut window = NisWindow::<3>::new();
        assert_eq!((window.inflation(), window.is_empty()), (1.0, true));
        assert!(window.push(40.0, 10));
        // √(40/10)
        assert_eq!((window.inflation(), window.len()), (2.0, 1));
        for _ in 0..3 {
            assert!(window.push(5.0, 10));
        }
        assert_eq!((window.inflation(), window.len(), window.sums()), (1.0, 3, (15.0, 30.0)));
        for (squares, count) in [(f64::NAN, 3), (f64::INFINITY, 3), (-1.0, 3), (3.0, 0)] {
            assert!(!window.push(squares, count));
        }
        assert_eq!(window.sums(), (15.0, 30.0));
        window.clear();
        assert!(window.is_empty());
        assert!(!NisWindow::<0>::new().push(1.0, 1), "a window of nothing");
    }
}
