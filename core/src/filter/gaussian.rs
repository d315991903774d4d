//! One Gaussian density of variable dimension: the state of a filter whose states are born, die and are re-defined.
//!
//! x ~ N(m, P), dimension n ≤ N at run time, P stored full and kept exactly symmetric. All operations are in place:
//!
//! | operation | meaning | cost |
//! |---|---|---|
//! | [`Gaussian::push`] | birth: a new independent state | O(n) |
//! | [`Gaussian::remove`] | death: marginalisation | O(n²) moves |
//! | [`Gaussian::renew`] | death and birth in one place | O(n) |
//! | [`Gaussian::inflate`] | a jump of one state: P_ii += V | O(1) |
//! | [`Gaussian::change_reference`] | unimodular map of differences | O(n·m) |
//! | [`Gaussian::propagate`] | x ← F x, P ← F P Fᵀ + Q of the kinematic states | O(n) |
//! | [`Gaussian::update`] | any number of measurement rows, by a [`Form`] | O(n²) a row |
//!
//! Panic contract: none; indices beyond the dimension are ignored. Stack: two scalars a loop.

use super::update::{Form, Gauge, Stage, UpdateError, VECTORS, Work};
use crate::linalg::{MatMut, symmetric};
use crate::real::Real;

/// No room for another state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CapacityError;

impl core::fmt::Display for CapacityError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("the density has no room for another state")
    }
}

impl core::error::Error for CapacityError {}

/// Memory for [`Gaussian::update`].
#[derive(Clone, Debug)]
pub struct UpdateWork<T, const N: usize> {
    correction: [T; N],
    /// Of the covariance before the update.
    diagonal: [T; N],
    vectors: [[T; N]; VECTORS],
}

impl<T: Real, const N: usize> Default for UpdateWork<T, N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real, const N: usize> UpdateWork<T, N> {
    /// Suits a `static`.
    pub const fn new() -> Self {
        Self { correction: [T::ZERO; N], diagonal: [T::ZERO; N], vectors: [[T::ZERO; N]; VECTORS] }
    }
}

/// N(m, P) with up to `N` states.
#[derive(Clone, Debug)]
pub struct Gaussian<T, const N: usize> {
    n: usize,
    mean: [T; N],
    covariance: [[T; N]; N],
}

impl<T: Real, const N: usize> Default for Gaussian<T, N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real, const N: usize> Gaussian<T, N> {
    /// The density without states; suits a `static`.
    pub const fn new() -> Self {
        Self { n: 0, mean: [T::ZERO; N], covariance: [[T::ZERO; N]; N] }
    }

    /// Number of states n.
    pub fn dim(&self) -> usize {
        self.n.min(N)
    }

    /// The mean m.
    pub fn mean(&self) -> &[T] {
        &self.mean[..self.dim()]
    }

    /// The mean m, to be changed.
    pub fn mean_mut(&mut self) -> &mut [T] {
        let n = self.dim();
        &mut self.mean[..n]
    }

    /// Row i of the covariance P (n entries); empty beyond the dimension.
    pub fn row(&self, i: usize) -> &[T] {
        let n = self.dim();
        if i < n { &self.covariance[i][..n] } else { &[] }
    }

    /// P_ij, 0 beyond the dimension.
    pub fn covariance(&self, i: usize, j: usize) -> T {
        self.row(i).get(j).copied().unwrap_or(T::ZERO)
    }

    /// P as one slice with `N` entries a row, of which the first n of the first n rows are in use.
    pub fn covariance_flat(&self) -> &[T] {
        self.covariance.as_flattened()
    }

    /// Forgets all states.
    pub fn clear(&mut self) {
        self.n = 0;
    }

    /// Becomes the marginal of the first `n` states of `other`, as many as there is room for.
    pub fn marginal_of<const M: usize>(&mut self, other: &Gaussian<T, M>, n: usize) {
        self.n = n.min(N).min(other.dim());
        let n = self.dim();
        for (mean, &value) in self.mean[..n].iter_mut().zip(other.mean()) {
            *mean = value;
        }
        for (row, other) in self.covariance[..n].iter_mut().zip(&other.covariance) {
            for (p, &value) in row[..n].iter_mut().zip(other) {
                *p = value;
            }
        }
    }

    /// Birth: appends an independent state and returns its index.
    pub fn push(&mut self, mean: T, variance: T) -> Result<usize, CapacityError> {
        let i = self.dim();
        if i == N {
            return Err(CapacityError);
        }
        self.n = i + 1;
        self.renew(i, mean, variance);
        Ok(i)
    }

    /// Death and birth: state i becomes independent of the others, with a new mean and variance.
    pub fn renew(&mut self, i: usize, mean: T, variance: T) {
        let n = self.dim();
        if i >= n {
            return;
        }
        for j in 0..n {
            self.covariance[i][j] = T::ZERO;
            self.covariance[j][i] = T::ZERO;
        }
        self.covariance[i][i] = variance;
        self.mean[i] = mean;
    }

    /// Death: marginalises state i; the states above move down by one.
    pub fn remove(&mut self, i: usize) {
        let n = self.dim();
        if i >= n {
            return;
        }
        close(&mut self.mean[..n], i);
        for row in &mut self.covariance[..n] {
            close(&mut row[..n], i);
        }
        close(&mut self.covariance[..n], i);
        self.n = n - 1;
    }

    /// A jump of state i with the given variance: P_ii += V.
    pub fn inflate(&mut self, i: usize, variance: T) {
        if i < self.dim() {
            self.covariance[i][i] += variance;
        }
    }

    /// Change of the reference of differences. The states `group` hold d_i = r − x_i for a common reference r. With
    /// state j ∈ `group` as the new reference they become d_i − d_j = x_j − x_i, and state j itself −d_j = x_j − r.
    /// The map is unimodular and its own inverse, so nothing is lost.
    pub fn change_reference(&mut self, j: usize, group: &[usize]) {
        let n = self.dim();
        if j >= n {
            return;
        }
        for &i in group.iter().filter(|&&i| i < n && i != j) {
            self.mean[i] -= self.mean[j];
            for k in 0..n {
                let d = self.covariance[j][k];
                self.covariance[i][k] -= d;
            }
        }
        self.mean[j] = -self.mean[j];
        for k in 0..n {
            self.covariance[j][k] = -self.covariance[j][k];
        }
        for row in &mut self.covariance[..n] {
            let d = row[j];
            for &i in group.iter().filter(|&&i| i < n && i != j) {
                row[i] -= d;
            }
            row[j] = -d;
        }
        // Rows and columns were transformed separately: one copy of each pair makes them equal to the last bit.
        for &i in group.iter().chain([&j]).filter(|&&i| i < n) {
            for k in 0..n {
                self.covariance[k][i] = self.covariance[i][k];
            }
        }
    }

    /// Prediction of the leading 3·`order` kinematic states, stacked by derivative: for each axis x ← F x,
    /// P ← F P Fᵀ + Q, with F upper triangular with unit diagonal and Q = `noise[axis]`, both `order`×`order`.
    pub fn propagate(&mut self, order: usize, f: &[[T; 3]; 3], noise: &[[[T; 3]; 3]; 3]) {
        let n = self.dim();
        if order > 3 || 3 * order > n {
            return;
        }
        // F is upper triangular: going from the lowest derivative up, each row still sees the old higher ones.
        for to in 0..order {
            for from in to + 1..order {
                let factor = f[to][from];
                for axis in 0..3 {
                    let (i, j) = (3 * to + axis, 3 * from + axis);
                    self.mean[i] += factor * self.mean[j];
                    for k in 0..n {
                        let term = factor * self.covariance[j][k];
                        self.covariance[i][k] += term;
                    }
                }
            }
        }
        for row in &mut self.covariance[..n] {
            for to in 0..order {
                for from in to + 1..order {
                    for axis in 0..3 {
                        row[3 * to + axis] += f[to][from] * row[3 * from + axis];
                    }
                }
            }
        }
        for (axis, q) in noise.iter().enumerate() {
            for a in 0..order {
                for b in 0..order {
                    self.covariance[3 * a + axis][3 * b + axis] += q[a][b];
                }
            }
        }
        for i in 0..3 * order {
            for k in 0..i {
                self.covariance[k][i] = self.covariance[i][k];
            }
            for k in 3 * order..n {
                self.covariance[k][i] = self.covariance[i][k];
            }
        }
    }

    /// Updates the density with the rows that `rows` hands to the [`Stage`], whose innovations are about the mean before
    /// the update, which it is given. On an error the density is as it was.
    pub fn update(
        &mut self,
        form: Form,
        work: &mut UpdateWork<T, N>,
        rows: impl FnOnce(&mut Stage<'_, T>, &[T]) -> Result<(), UpdateError>,
    ) -> Result<Gauge<T>, UpdateError> {
        let n = self.dim();
        let UpdateWork { correction, diagonal, vectors } = work;
        let (correction, diagonal) = (&mut correction[..n], &mut diagonal[..n]);
        let mut p = MatMut::new(self.covariance.as_flattened_mut(), n, n, N)?;
        let work = Work {
            rows: MatMut::new(&mut [], 0, n, n)?,
            vectors: MatMut::new(vectors.as_flattened_mut(), VECTORS, n, N)?,
        };
        correction.fill(T::ZERO);
        // The stage works on the lower triangle; the upper one and the diagonal are the way back.
        symmetric::keep_diagonal(p.as_ref(), diagonal);
        let mean = &mut self.mean[..n];
        let outcome = Stage::begin(form, correction, p.reborrow(), work).and_then(|mut stage| {
            rows(&mut stage, mean)?;
            stage.finish()
        });
        match outcome {
            Ok(_) => {
                p.mirror_lower();
                crate::linalg::axpy(mean, T::ONE, correction);
            }
            Err(_) => symmetric::restore(&mut p, diagonal),
        }
        outcome
    }

    /// Whether the mean is finite and every variance positive and finite.
    pub fn is_sound(&self) -> bool {
        let n = self.dim();
        self.mean[..n].iter().all(|m| m.is_finite())
            && (0..n).all(|i| self.covariance[i][i] > T::ZERO && self.covariance[i][i].is_finite())
    }
}

/// Moves what is above place i down by one.
fn close<E: Copy>(list: &mut [E], i: usize) {
    if let Some(from @ [_, ..]) = list.get_mut(i..) {
        from.copy_within(1.., 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::Mat;
    use nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;

    /// A density with a random covariance A Aᵀ + I of dimension n.
    fn density(n: usize, seed: &[f64]) -> Gaussian<f64, 12> {
        let a = DMatrix::from_fn(n, n, |i, j| seed[(i * 7 + j * 3) % seed.len()]);
        let p = &a * a.transpose() + DMatrix::identity(n, n);
        let mut density = Gaussian::new();
        for i in 0..n {
            density.push(seed[i % seed.len()] * 3.0, 1.0).unwrap();
        }
        for i in 0..n {
            for j in 0..n {
                density.covariance[i][j] = (p[(i, j)] + p[(j, i)]) / 2.0;
            }
        }
        density
    }

    fn dense(density: &Gaussian<f64, 12>) -> (DVector<f64>, DMatrix<f64>) {
        let n = density.dim();
        (DVector::from_row_slice(density.mean()), DMatrix::from_fn(n, n, |i, j| density.covariance(i, j)))
    }

    /// x ↦ T x applied densely.
    fn mapped(density: &Gaussian<f64, 12>, t: &DMatrix<f64>) -> (DVector<f64>, DMatrix<f64>) {
        let (m, p) = dense(density);
        (t * m, t * p * t.transpose())
    }

    fn assert_close(density: &Gaussian<f64, 12>, expected: (DVector<f64>, DMatrix<f64>)) {
        let (m, p) = dense(density);
        assert!((m - expected.0).amax() < 1e-10 && (&p - expected.1).amax() < 1e-10);
        assert_eq!(p, p.transpose());
    }

    proptest! {
        #[test]
        fn change_of_reference_is_the_unimodular_map_and_its_own_inverse(
            seed in prop::collection::vec(-1.0..1.0f64, 9), j in 4usize..8
        ) {
            let before = density(9, &seed);
            let group = [4, 5, 6, 7];
            let t = DMatrix::from_fn(9, 9, |r, c| {
                let member = group.contains(&r) && c == j;
                f64::from(u8::from(r == c && r != j)) - f64::from(u8::from(member))
            });
            let mut after = before.clone();
            after.change_reference(j, &group);
            assert_close(&after, mapped(&before, &t));
            after.change_reference(j, &group);
            assert_close(&after, dense(&before));
        }

        #[test]
        fn prediction_is_f_p_ft_plus_q(seed in prop::collection::vec(-1.0..1.0f64, 9), h in 0.01..30.0f64) {
            let before = density(8, &seed);
            let f3 = [[1.0, h, 0.0], [0.0, 1.0, 0.0], [0.0; 3]];
            let q = [[h * h, 0.5 * h, 0.0], [0.5 * h, 1.0, 0.0], [0.0; 3]];
            let mut after = before.clone();
            after.propagate(2, &f3, &[q; 3]);
            let f = DMatrix::from_fn(8, 8, |r, c| if r == c { 1.0 } else if r < 3 && c == r + 3 { h } else { 0.0 });
            let mut expected = mapped(&before, &f);
            for (a, b, axis) in (0..12).map(|k| (k / 6, k / 3 % 2, k % 3)) {
                expected.1[(3 * a + axis, 3 * b + axis)] += q[a][b];
            }
            assert_close(&after, expected);
        }

        #[test]
        fn removing_a_state_keeps_the_marginal_of_the_rest(
            seed in prop::collection::vec(-1.0..1.0f64, 9), gone in 0usize..7
        ) {
            let before = density(7, &seed);
            let mut after = before.clone();
            after.remove(gone);
            let (m, p) = dense(&before);
            assert_close(&after, (m.remove_row(gone), p.remove_row(gone).remove_column(gone)));
        }

        #[test]
        fn update_is_the_kalman_update(seed in prop::collection::vec(-1.0..1.0f64, 9), y in -5.0..5.0f64) {
            let before = density(6, &seed);
            let h = DVector::from_fn(6, |i, _| if i == 2 { 0.0 } else { seed[i] });
            let (m, p) = dense(&before);
            let s = (h.transpose() * &p * &h)[0] + 0.3;
            let k = &p * &h / s;
            let innovation = y - (h.transpose() * &m)[0];
            let expected = (m + &k * innovation, p - &k * s * k.transpose());
            let row = Mat::new(h.as_slice(), 1, 6, 6).unwrap();
            for form in [Form::Sequential, Form::Joseph, Form::Array] {
                let mut after = before.clone();
                let gauge = after.update(form, &mut UpdateWork::new(), |stage, _| {
                    stage.independent(&row, 0..1, |_| innovation, |_| 0.3)
                });
                prop_assert!((gauge.unwrap().normalized_innovation_squared * s / innovation.powi(2) - 1.0).abs() < 1e-9);
                assert_close(&after, expected.clone());
            }
        }
    }

    #[test]
    fn a_full_density_refuses_and_bad_indices_are_ignored() {
        let mut density = Gaussian::<f64, 2>::new();
        assert_eq!((density.push(1.0, 1.0), density.push(2.0, 4.0)), (Ok(0), Ok(1)));
        assert_eq!(density.push(3.0, 9.0), Err(CapacityError));
        let before = density.clone();
        density.remove(2);
        density.inflate(7, 1.0);
        density.change_reference(2, &[0, 1]);
        density.propagate(1, &[[1.0; 3]; 3], &[[[1.0; 3]; 3]; 3]);
        assert_eq!((density.mean(), density.row(1)), (before.mean(), before.row(1)));
        let row = [1.0, 0.0];
        let outcome = density.update(Form::Sequential, &mut UpdateWork::new(), |stage, _| {
            stage.independent(&Mat::new(&row, 1, 2, 2)?, 0..1, |_| f64::NAN, |_| 1.0)
        });
        assert!(outcome.is_err());
        assert_eq!((density.mean(), density.row(1)), (before.mean(), before.row(1)));
        assert!(density.is_sound());
    }
}
