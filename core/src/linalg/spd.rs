//! Random symmetric positive definite matrices for property tests.

use proptest::prelude::*;

/// n, and an n × n matrix S (G Gᵀ + ε I) S with |g_ij| ≤ 1, ε from 1e-4 to 1 and scales S from 0.1 to 10: condition
/// numbers up to about 1e9.
pub fn matrix(n: impl Strategy<Value = usize>) -> impl Strategy<Value = (usize, Vec<f64>)> {
    n.prop_flat_map(|n| {
        let g = proptest::collection::vec(-1.0..1.0f64, n * n);
        let scales = proptest::collection::vec(-1.0..1.0f64, n);
        (Just(n), g, scales, -4.0..0.0f64).prop_map(|(n, g, scales, epsilon)| (n, assemble(n, &g, &scales, epsilon)))
    })
}

fn assemble(n: usize, g: &[f64], scales: &[f64], epsilon: f64) -> Vec<f64> {
    let mut q = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..=i {
            let gram: f64 = (0..n).map(|k| g[i * n + k] * g[j * n + k]).sum();
            let ridge = if i == j { 10f64.powf(epsilon) } else { 0.0 };
            let value = (gram + ridge) * 10f64.powf(scales[i] + scales[j]);
            q[i * n + j] = value;
            q[j * n + i] = value;
        }
    }
    q
}

/// Entry (i, j) of A B for packed n × n matrices.
pub fn product(n: usize, a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut c = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..n {
            c[i * n + j] = (0..n).map(|k| a[i * n + k] * b[k * n + j]).sum();
        }
    }
    c
}

/// The lower triangle with zeros above it.
pub fn lower(n: usize, a: &[f64]) -> Vec<f64> {
    (0..n * n).map(|k| if k % n <= k / n { a[k] } else { 0.0 }).collect()
}

/// Aᵀ.
pub fn transposed(n: usize, a: &[f64]) -> Vec<f64> {
    (0..n * n).map(|k| a[(k % n) * n + k / n]).collect()
}
