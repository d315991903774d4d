//! Every kernel of `linalg`, `integer`, `filter::adaptive`, `integrity` and `smooth` in both scalars, so that `cargo xtask panics` sees also those that the replay
//! does not link. Dimensions come from where the compiler cannot see them; what the kernels answer does not matter.
#![no_std]
#![no_main]

use core::hint::black_box as hide;
use surefix_core::filter::adaptive::forgetting::{Beta, Forgetting};
use surefix_core::filter::adaptive::matrix::{self, FloorWork, Origin};
use surefix_core::filter::adaptive::ratio;
use surefix_core::gnss::baseline::Attitude;
use surefix_core::gnss::solution::{Reason, Solution};
use surefix_core::gnss::time::GpsTime;
use surefix_core::integer::accept::Thresholds;
use surefix_core::integer::failure_rate::FailureRate;
use surefix_core::integer::search::{Level, search};
use surefix_core::integer::subset::{Options, Strategy, SubsetWorkspace, resolve_subset};
use surefix_core::integer::success_rate::{self, Probability};
use surefix_core::integer::{Config, IntegerError, Workspace, resolve, resolve_partial};
use surefix_core::integer::{bootstrap, condition, decorrelate, partial, rounding};
use surefix_core::integrity::protection::{self, HorizontalFactor};
use surefix_core::integrity::stanford::Counts;
use surefix_core::integrity::window::NisWindow;
use surefix_core::linalg::sequential::{Row, update_scalar, update_scalar_joseph};
use surefix_core::linalg::{LinalgError, Mat, MatMut};
use surefix_core::linalg::{block, cholesky, eigen, ldl, projection, square_root, symmetric, triangular};
use surefix_core::real::Real;
use surefix_core::smooth::disturbance::Adjoint;
use surefix_core::smooth::step::{Block, SparseMap, Step};
use surefix_core::smooth::{Moments, MomentsMut, SmoothError, em, predict, rts};
use surefix_firmware::board::{self, Board};

/// Largest dimension.
const N: usize = 4;
/// Buffers that a kernel may need.
const BUFFERS: usize = 5;

#[cortex_m_rt::entry]
fn main() -> ! {
    let Some(_board) = Board::take() else { board::exit(1) };
    integrity();
    let shapes_fit = kernels::<f64>(hide(N)).is_ok()
        && kernels::<f32>(hide(N)).is_ok()
        && smoothers::<f64>(hide(N)).is_ok()
        && smoothers::<f32>(hide(N)).is_ok();
    defmt::info!("every kernel returned, shapes fit: {=bool}", shapes_fit);
    board::exit(if shapes_fit { 0 } else { 1 })
}

/// Calls them all. A result is hidden, so that no call can be left out.
fn kernels<T: Real>(n: usize) -> Result<(), LinalgError> {
    let mut matrices = [[T::ONE; N * N]; BUFFERS];
    let mut vectors = [[T::ONE; N]; BUFFERS];
    let mut integers = [[1; N * N]; 3];
    let [a, b, c, d, e] = hide(&mut matrices);
    let [u, v, w, x, y] = hide(&mut vectors);
    let [k, l, m] = hide(&mut integers);
    let (a, b, c) = (&mut MatMut::square(a, n)?, &mut MatMut::square(b, n)?, &mut MatMut::square(c, n)?);
    let (d, e) = (&mut MatMut::square(d, n)?, &mut MatMut::square(e, n)?);
    let (k, l) = (&mut MatMut::square(k, n)?, &mut MatMut::square(l, n)?);
    let [u, v, w, x, y] = [u, v, w, x, y].map(|vector| vector.get_mut(..n).unwrap_or_default());
    let m = m.get_mut(..n).unwrap_or_default();
    let indices = hide([0, 1, 2, 3]);
    let indices = indices.get(..n).unwrap_or_default();
    let (i, j) = (hide(1), hide(2));

    views(a, b.as_ref(), i, j);
    hide(cholesky::factor(a).is_ok());
    hide(cholesky::solve(a.as_ref(), u).is_ok());
    hide(cholesky::log_determinant(a.as_ref()));
    hide(ldl::factor_ltdl(a, u).is_ok());
    hide(
        ldl::factor_ltdl_sorted(a, u, |i, j| {
            hide([i, j]);
        })
        .is_ok(),
    );
    hide(ldl::factor_ldlt(a, u).is_ok());
    hide(eigen::eigenvalues(a, u).is_ok());
    hide(eigen::decompose(a, u, b).is_ok());
    hide(triangular::forward(a.as_ref(), u).is_ok());
    hide(triangular::back_transposed(a.as_ref(), u).is_ok());
    hide(triangular::forward_rows(a.as_ref(), b).is_ok());
    hide(triangular::back_transposed_rows(a.as_ref(), b).is_ok());
    hide(triangular::invert(a).is_ok());
    hide(block::update_block(u, a, b.as_ref(), v, c, d).is_ok());
    hide(block::whiten(a, u, b).is_ok());
    hide(update_scalar(u, a, Row::Dense(v), T::ONE, T::ONE, w).is_ok());
    hide(update_scalar(u, a, Row::Sparse { indices, values: v }, T::ONE, T::ONE, w).is_ok());
    hide(update_scalar_joseph(u, a, Row::Dense(v), T::ONE, T::ONE, w, x).is_ok());
    hide(square_root::update(a, u, T::ONE, v, w, x).is_ok());
    hide(projection::orthogonalize(a, b).is_ok());
    projection::remove(a, b.as_ref(), u);
    hide(projection::solve(a.as_ref(), b.as_ref(), u, v).is_ok());
    symmetric::add_row(a.as_ref(), i, T::ONE, u);
    symmetric::copy_row(a.as_ref(), i, u);
    symmetric::shear(a, i, j, T::ONE);
    symmetric::scale_state(a, i, T::ONE);
    symmetric::subtract_gram(a, b.as_ref());
    symmetric::square(a);
    symmetric::square_transposed(a);
    symmetric::restore(a, u);
    symmetric::keep_diagonal(a.as_ref(), u);
    hide(symmetric::check(a.as_ref()).is_ok());
    hide(symmetric::check_diagonal(a.as_ref()).is_ok());

    hide(decorrelate::decorrelate(a, u, k, l).is_ok());
    hide(decorrelate::transform(k.as_ref(), u, v).is_ok());
    hide(decorrelate::back_transform(k.as_ref(), u, v).is_ok());
    hide(decorrelate::back_transform_integers(k.as_ref(), l.row(i), m).is_ok());
    hide(rounding::round(u, m).is_ok());
    hide(bootstrap::bootstrap(u, a.as_ref(), v, m, w).is_ok());
    hide(bootstrap::bootstrap_ordered(u, a.as_ref(), indices, b, v, w, m).is_ok());
    hide(search(u, a.as_ref(), v, 9, k, w, hide(&mut [Level::ZERO; N]), x).is_ok());
    hide(partial::select(u, a.as_ref(), indices, v, b).is_ok());
    hide(condition::condition_on_integers(u, a.as_ref(), indices, indices, v, b, c, w, x, d).is_ok());

    let (workspace, config, thresholds) =
        (&mut Workspace::new(), Config { budget: hide(9) }, hide(Thresholds::default()));
    let workspace: &mut Workspace<T, N> = workspace;
    hide(resolve(u, a.as_ref(), &config, workspace).map(|found| hide(found).decide(&thresholds)).is_ok());
    hide(resolve_partial(u, a.as_ref(), 0.9, &config, workspace).map(|found| hide(found).decide(&thresholds)).is_ok());
    hide(success_rate::bootstrapped(y));
    hide([success_rate::rounding_lower(a.as_ref()), success_rate::rounding_upper(a.as_ref())]);
    let adop = success_rate::adop(y);
    hide([success_rate::adop_upper(adop, n), success_rate::ils_upper(adop, n), success_rate::ball_lower(adop, n)]);
    hide([success_rate::eigenvalue_lower(adop, n), success_rate::eigenvalue_upper(adop, n)]);
    hide(success_rate::slab_upper(a.as_ref(), k.as_ref(), b, c, e, u).is_ok());
    hide(parts(u, a.as_ref(), hide(Strategy::Search { budget: 9 })).is_ok());
    hide(parts(u, a.as_ref(), hide(Strategy::Elevation)).is_ok());
    noise(u, [a, b, c, d, e], v)?;
    hide(FailureRate::Percent.ratio_threshold(hide(Probability { success: 0.9, failure: 0.1 }), n));
    Ok(())
}

/// Partial fixing; returns how many are fixed.
fn parts<T: Real>(a: &[T], q: Mat<'_, T>, strategy: Strategy) -> Result<usize, IntegerError> {
    let mut workspace = SubsetWorkspace::<T, N>::new();
    let options = hide(Options { strategy, min_satellites: 1, ..Options::default() });
    let (of, order) = (hide([0, 1, 0, 1]), hide([1, 0]));
    let subset = resolve_subset(a, q, of.get(..a.len()).unwrap_or_default(), &order, &options, &mut workspace)?;
    Ok(subset.map_or(0, |subset| hide(subset).indices.len()))
}

/// Adaptive noise.
fn noise<T: Real>(u: &mut [T], [a, b, c, d, e]: [&mut MatMut<'_, T>; 5], v: &mut [T]) -> Result<(), LinalgError> {
    let n = u.len();
    for form in [matrix::Form::Innovation, matrix::Form::Residual] {
        hide(matrix::blend(a, T::ONE, u, b.as_ref(), form).is_ok());
    }
    hide(matrix::check(a.as_ref(), c).is_ok());
    let origins = hide([Origin::Same(0), Origin::Difference(1, 0), Origin::Negative(1), Origin::New]);
    hide(matrix::remap(c, a.as_ref(), b.as_ref(), origins.get(..n).unwrap_or_default()).is_ok());
    hide(ratio::factor(b.as_ref(), c).is_ok());
    hide(ratio::mean_ratio(c.as_ref(), u, d).is_ok());
    hide(ratio::scale(d, b.as_ref(), u).is_ok());
    hide(ratio::blend(T::ONE, T::ONE, T::ONE, [T::ONE; 2]));
    let mut work = FloorWork { factor: c.reborrow(), square: d.reborrow(), vectors: e.reborrow(), values: v };
    hide(matrix::floor(a, b.as_ref(), [T::ONE; 2], &mut work).is_ok());
    Ok(())
}

/// Risk, protection levels and their record.
fn integrity() {
    let solution = hide(Solution::none(GpsTime::from_nanoseconds(0), Reason::NoBase));
    let config = hide(protection::Config { horizontal_factor: HorizontalFactor::Exact, ..protection::Config::DEFAULT });
    if let Ok(factors) = config.factors() {
        let levels = factors.levels(&solution.position_covariance, hide(1.0));
        hide((factors.status(levels), factors.basis(hide(0.1), hide(true))));
    }
    let mut window = NisWindow::<3>::new();
    hide(window.push(hide(1.0), hide(1)));
    hide((window.inflation(), window.sums()));
    hide(Counts::default().add(hide(1.0), hide(2.0), hide(3.0)));
    hide(Attitude::of(&solution.position, &solution.position_covariance));
    hide(Beta::new(hide(1.0)).next(&hide(Forgetting::IAVAKF), hide(0.99)));
}

/// The steps of the smoothers and the sums of EM.
fn smoothers<T: Real>(n: usize) -> Result<(), SmoothError> {
    let mut matrices = [[T::ONE; N * N]; 7];
    let mut vectors = [[T::ONE; N]; 7];
    let mut buffer = [T::ONE; rts::buffer_len(N, N)];
    let [a, b, c, d, e, f, g] = hide(&mut matrices);
    let [u, v, w, x, y, z, t] = hide(&mut vectors).each_mut().map(|vector| vector.get_mut(..n).unwrap_or_default());
    let (mut work, mut unit) = (MatMut::square(f, n)?, MatMut::square(g, n)?);

    let noise = hide([Block {
        states: [0, 1, 2],
        dim: 2,
        shape: [[T::ONE, T::ZERO, T::ZERO], [T::ZERO, T::ONE, T::ZERO], [T::ZERO; 3]],
        scale: T::ONE,
        component: Some(0),
    }]);
    let (ends, entries) = (hide([1, 2, 3, 4]), hide([(0, T::ONE), (1, T::ONE), (2, T::ONE), (3, T::ONE)]));
    let map = SparseMap { ends: ends.get(..n).unwrap_or_default(), entries: &entries, columns: n };
    let step = Step { map, offset: t, noise: &noise };

    let filtered = Moments::packed(u, a)?;
    let mut predicted = MomentsMut::packed(v, b)?;
    let next = Moments::packed(w, c)?;
    hide(predict::predict(&step, filtered, &mut predicted, &mut work).is_ok());
    let mut smoothed = MomentsMut::packed(x, d)?;
    let mut steps = rts::Work::new(&mut buffer, n, n)?;
    hide(rts::smooth(&step, filtered, &mut predicted, next, &mut smoothed, &mut steps).is_ok());
    hide(steps.lag_one(next.covariance, &mut work).is_ok());

    let mut adjoint = Adjoint::packed(y, e)?;
    hide(adjoint.measurement(filtered.mean, next.mean, T::ONE, T::ONE, z).is_ok());
    hide(adjoint.noise(&noise[0]).is_ok());
    hide(adjoint.smooth(filtered, &mut smoothed, &mut work).is_ok());
    let mut before = Adjoint { score: predicted.mean, information: predicted.covariance };
    hide(adjoint.time_step(&step, &mut before, &mut work).is_ok());

    let mut sum = em::Sum::default();
    hide(em::process(&step, filtered, next, &mut work, |_, other| sum.merge(other)).is_ok());
    hide(sum.scale());
    hide(em::independent(&map, 0..hide(n), |_| T::ONE, |_| T::ONE, next.covariance, z).is_ok());
    let (product, covariance) = (&mut before.information, next.covariance);
    hide(em::correlated(&map, hide(0), z, &mut unit, covariance, &mut work, product).is_ok());
    Ok(())
}

/// Views of matrices.
fn views<T: Real>(a: &mut MatMut<'_, T>, b: Mat<'_, T>, i: usize, j: usize) {
    a.swap_rows(i, j);
    hide(a.row_pair(i, j));
    a.mirror_lower();
    a.transpose();
    a.symmetrize();
    a.fill(T::ONE);
    hide(a.copy_from(b).is_ok());
    hide(a.block_mut(i, i, j, j).is_ok());
    hide(b.block(i, i, j, j).is_ok());
    hide(a.get(i, j));
    a.set(i, j, T::ONE);
}
