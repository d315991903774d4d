//! The kernels of the core, compiled for the vector unit of the processor at hand.
//!
//! The core is compiled for every processor of its architecture. Its kernels are inlined, so a closure that calls them
//! can be compiled once more for wider vectors, and which of the two runs is decided by what the processor has. Results are
//! the same to the last bit: the order of sums does not depend on the width, and no operations are fused.

use pulp::Arch;
use std::sync::LazyLock;

static ARCH: LazyLock<Arch> = LazyLock::new(Arch::new);

/// Runs `kernel` with the widest vectors of this processor. What `kernel` calls has to be inlined into it, the closure
/// itself too (`#[inline(always)]`).
#[inline]
pub fn vectorised<R>(kernel: impl FnOnce() -> R) -> R {
    ARCH.dispatch(kernel)
}

#[cfg(test)]
mod tests {
    use super::vectorised;
    use surefix_core::linalg::tiles::{Tiles, buffer_len};

    #[test]
    fn vectors_change_no_bit() {
        let n = 37;
        let factor = |vector: bool| {
            let mut buffer = vec![0.0; buffer_len(n, n)];
            let (mut tiles, _) = Tiles::split(&mut buffer, n, n).expect("long enough");
            tiles.load_symmetric(n, 1.0, |i, row| {
                row.iter_mut().enumerate().for_each(|(j, x)| *x = if i == j { 3.0 } else { 1.0 / (1 + i + j) as f64 });
            });
            let outcome = if vector {
                vectorised(
                    #[inline(always)]
                    || tiles.factor(),
                )
            } else {
                tiles.factor()
            };
            outcome.expect("positive definite");
            buffer.into_iter().map(f64::to_bits).collect::<Vec<_>>()
        };
        assert_eq!(factor(true), factor(false));
    }
}
