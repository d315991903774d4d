//! The χ² distribution with k degrees of freedom.
//!
//! F(x; k) = P(k/2, x/2) with the regularised incomplete gamma function: its power series (Abramowitz & Stegun
//! 6.5.29) for x/2 < k/2 + 1, its continued fraction (6.5.31, by Lentz's method) beyond, at most
//! [`MAX_ITERATIONS`] terms. Relative accuracy about 1e-13·max(1, k/100), in the tail too. Quantiles start from
//! Wilson & Hilferty (1931) and take bracketed Newton steps.

/// Bound on terms of a series or fraction; enough up to k = 100 000.
pub const MAX_ITERATIONS: u32 = 4000;

/// F(x; k) = P(X ≤ x). NaN for k = 0 or x NaN.
pub fn cdf(x: f64, degrees: u32) -> f64 {
    gamma_regularized(0.5 * f64::from(degrees), 0.5 * x).0
}

/// P(X > x) = 1 − F(x; k), accurate in the tail. NaN for k = 0 or x NaN.
pub fn survival(x: f64, degrees: u32) -> f64 {
    gamma_regularized(0.5 * f64::from(degrees), 0.5 * x).1
}

/// The x with F(x; k) = p. 0 and ∞ at p = 0 and 1, NaN outside and for k = 0.
pub fn quantile(p: f64, degrees: u32) -> f64 {
    if p > 0.5 { upper_quantile(1.0 - p, degrees) } else { solve(p, degrees, |x| cdf(x, degrees) - p) }
}

/// The x with P(X > x) = q, accurate for small q. ∞ and 0 at q = 0 and 1, NaN outside and for k = 0.
pub fn upper_quantile(q: f64, degrees: u32) -> f64 {
    if q > 0.5 { quantile(1.0 - q, degrees) } else { solve(1.0 - q, degrees, |x| q - survival(x, degrees)) }
}

/// The root of the increasing `excess`, whose derivative is the density, started at the quantile of about `p`.
fn solve(p: f64, degrees: u32, excess: impl Fn(f64) -> f64) -> f64 {
    if degrees == 0 || !(0.0..=1.0).contains(&p) {
        return f64::NAN;
    }
    if excess(f64::INFINITY) <= 0.0 {
        return f64::INFINITY;
    }
    if excess(0.0) >= 0.0 {
        return 0.0;
    }
    let k = f64::from(degrees);
    let (mut low, mut high) = (0.0, k + 1.0);
    while excess(high) < 0.0 && high < 1e300 {
        low = high;
        high *= 2.0;
    }
    let spread = 2.0 / (9.0 * k);
    let root = 1.0 - spread + super::normal::quantile(p) * libm::sqrt(spread);
    let mut x = k * root * root * root;
    for _ in 0..200 {
        if !(x > low && x < high) {
            x = 0.5 * (low + high);
        }
        let value = excess(x);
        if value == 0.0 {
            return x;
        }
        if value < 0.0 {
            low = x;
        } else {
            high = x;
        }
        let step = value / density(x, k);
        if libm::fabs(step) <= 2.0 * f64::EPSILON * x || high - low <= f64::EPSILON * high {
            return x;
        }
        x -= step;
    }
    x
}

/// Density at x > 0.
fn density(x: f64, k: f64) -> f64 {
    let a = 0.5 * k;
    0.5 * libm::exp((a - 1.0) * libm::log(0.5 * x) - 0.5 * x - libm::lgamma(a))
}

/// (P(a, x), Q(a, x)), the regularised incomplete gamma functions.
fn gamma_regularized(a: f64, x: f64) -> (f64, f64) {
    if a <= 0.0 || x.is_nan() {
        return (f64::NAN, f64::NAN);
    }
    if x <= 0.0 {
        return (0.0, 1.0);
    }
    if x == f64::INFINITY {
        return (1.0, 0.0);
    }
    let scale = libm::exp(a * libm::log(x) - x - libm::lgamma(a));
    if x < a + 1.0 {
        let lower = scale * series(a, x);
        (lower, 1.0 - lower)
    } else {
        let upper = scale * fraction(a, x);
        (1.0 - upper, upper)
    }
}

/// Σ xⁿ / (a (a+1) … (a+n)).
fn series(a: f64, x: f64) -> f64 {
    let mut term = 1.0 / a;
    let mut sum = term;
    let mut denominator = a;
    for _ in 0..MAX_ITERATIONS {
        denominator += 1.0;
        term *= x / denominator;
        sum += term;
        if term <= sum * 1e-17 {
            break;
        }
    }
    sum
}

/// 1/(x + 1 − a − 1·(1 − a)/(x + 3 − a − 2·(2 − a)/(x + 5 − a − …))).
fn fraction(a: f64, x: f64) -> f64 {
    const TINY: f64 = 1e-300;
    let mut b = x + 1.0 - a;
    let mut c = 1.0 / TINY;
    let mut d = 1.0 / b;
    let mut value = d;
    for i in 1..=MAX_ITERATIONS {
        let i = f64::from(i);
        let numerator = -i * (i - a);
        b += 2.0;
        d = 1.0 / nonzero(numerator * d + b, TINY);
        c = nonzero(b + numerator / c, TINY);
        let factor = d * c;
        value *= factor;
        if libm::fabs(factor - 1.0) <= f64::EPSILON {
            break;
        }
    }
    value
}

/// `x`, or `tiny` in place of zero.
fn nonzero(x: f64, tiny: f64) -> f64 {
    if libm::fabs(x) < tiny { tiny } else { x }
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{ChiSquared, ContinuousCDF};

    #[test]
    fn agrees_with_statrs() {
        for degrees in [1, 2, 3, 5, 12, 40, 200, 1000] {
            let reference = ChiSquared::new(f64::from(degrees)).unwrap();
            for i in 1..60 {
                let x = f64::from(degrees) * f64::from(i) * 0.05;
                assert!((cdf(x, degrees) - reference.cdf(x)).abs() < 1e-10, "{degrees} {x}");
                assert!((survival(x, degrees) - reference.sf(x)).abs() < 1e-10, "{degrees} {x}");
            }
        }
    }

    /// k = 2: Q(x) = exp(−x/2); k = 1: Q(x) = erfc(√(x/2)); k = 4: (1 + x/2) exp(−x/2).
    #[test]
    fn closed_forms_hold_in_the_tail() {
        for x in [0.01, 1.0, 3.0, 10.0, 50.0, 200.0, 1000.0] {
            for (degrees, expected) in [
                (2, libm::exp(-0.5 * x)),
                (1, libm::erfc(libm::sqrt(0.5 * x))),
                (4, (1.0 + 0.5 * x) * libm::exp(-0.5 * x)),
            ] {
                assert!((survival(x, degrees) / expected - 1.0).abs() < 3e-13, "{degrees} {x}");
            }
        }
    }

    #[test]
    fn quantile_inverts() {
        for degrees in [1, 2, 3, 7, 63, 500, 5000] {
            for p in [1e-12, 1e-6, 0.01, 0.3, 0.5, 0.9, 0.99, 0.999_999] {
                let x = quantile(p, degrees);
                assert!((cdf(x, degrees) / p - 1.0).abs() < 1e-9, "{degrees} {p} {x}");
                let x = upper_quantile(p, degrees);
                assert!((survival(x, degrees) / p - 1.0).abs() < 1e-9, "{degrees} {p} {x}");
            }
        }
        // Standard tables: 95 % points of χ² with 1 and 3 degrees of freedom.
        assert!((quantile(0.95, 1) - 3.841_458_820_694_124).abs() < 1e-12);
        assert!((quantile(0.95, 3) - 7.814_727_903_251_179).abs() < 1e-12);
    }

    #[test]
    fn edges_are_total() {
        assert_eq!((cdf(-1.0, 3), survival(-1.0, 3)), (0.0, 1.0));
        assert_eq!((cdf(f64::INFINITY, 3), survival(f64::INFINITY, 3)), (1.0, 0.0));
        assert_eq!((quantile(0.0, 3), quantile(1.0, 3)), (0.0, f64::INFINITY));
        assert_eq!((upper_quantile(1.0, 3), upper_quantile(0.0, 3)), (0.0, f64::INFINITY));
        assert!(cdf(1.0, 0).is_nan() && quantile(0.5, 0).is_nan() && cdf(f64::NAN, 2).is_nan());
        assert!(quantile(-0.1, 2).is_nan() && quantile(f64::NAN, 2).is_nan() && upper_quantile(1.1, 2).is_nan());
    }
}
