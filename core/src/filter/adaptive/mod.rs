//! Measurement noise that follows the data.
//!
//! ```text
//! R*_k = (1 − β_k) R*_{k−1} + β_k E_k
//! E = ν νᵀ − H P⁻ Hᵀ     innovation form, as printed (Wang et al. 2022, eq. 25; ν innovation, P⁻ prior covariance)
//! E = ε εᵀ + H P⁺ Hᵀ     residual form (ε residual, P⁺ posterior covariance)
//! ```
//! A. P. Sage & G. W. Husa, *Adaptive filtering with unknown prior statistics*, Joint Automatic Control Conference (1969);
//! A. H. Mohamed & K. P. Schwarz, *Adaptive Kalman filtering for INS/GPS*, J. Geodesy 73 (1999) for the residual form.
//!
//! * [`forgetting`]: β, by a constant (Sage–Husa) or by the success rate (IAVAKF, eq. 24).
//! * [`matrix`]: R* as a whole matrix, in both forms, with a floor; changes of satellites and of the reference.
//! * [`ratio`]: R* = D^½ R₀ D^½ with a ratio for each type or each channel, which keeps the correlation of differences and
//!   is positive definite by construction; what a receiver should use.
//!
//! The innovation form as printed is positive definite only for β < 1/(1 + λ), λ the largest eigenvalue of
//! R⁻¹ H P⁻ Hᵀ: with metres of position uncertainty and millimetres of phase noise, β < 4·10⁻⁵. Without a floor it fails at
//! the first epoch, and says so. What P_s and β do to each other has the wrong sign, too: an R* that is too small makes P_s
//! nearly 1, and then nothing is learned any more. Therefore β is kept within bounds, and Sage–Husa with ratios is the
//! default.
//!
//! No panics, no allocation.

pub mod forgetting;
pub mod matrix;
pub mod ratio;
