//! Ocean loading: the crust bends under the water that the tides move.
//!
//! A BLQ file gives, for a place, amplitude and phase of 11 constituents. The tides are more: this sums 342 waves
//! as the routine HARDISP of the IERS Conventions 2010 (7.1.2) does. With the admittance (response per unit of the
//! tide-generating potential) Zₖ = Aₖ e^(−iφₖ) / |Hₖ| of the constituents k, that of any wave w is interpolated over
//! frequency within its band, by a cubic spline with end slopes from parabolas (diurnal and semidiurnal) or straight
//! lines (long period), constant outside; the displacement is Σ_w H_w Re(Z(f_w) e^(iθ_w)), with θ the Doodson argument
//! at the time (UTC for the hour angle), plus 90° in the diurnal and 180° in the long-period band.
//!
//! Interpolation is linear in the Zₖ. So the shares in which each wave falls to the constituents of its band are worked
//! out when compiling, and a time needs one sum over the waves that *no station enters*: [`Constituents`], eleven
//! complex numbers, each a constituent with all its nodal and other modulations. A station then costs 66 products
//! ([`OceanLoading::displacement_with`]), so that many stations share the sum.
//!
//! Cost: [`Constituents::at`] 12 000 floating-point operations and eight pairs of sine and cosine; 9 KB of tables, 0.6
//! KB of stack. The displacement moves by less than 15 µm/s, so a receiver may hold it for seconds. Panic contract:
//! none.

use super::waves::{DIURNAL, LONG_PERIOD, SEMIDIURNAL, Wave};
use crate::gnss::earth_rotation::{DEGREE, Delaunay, terrestrial_centuries, utc_day};
use crate::gnss::time::GpsTime;
use core::f64::consts::TAU;
use nalgebra::Vector3;

/// Constituents of a BLQ file: M2, S2, N2, K2, K1, O1, P1, Q1, Mf, Mm, Ssa.
pub const CONSTITUENTS: usize = 11;

/// Response of a station to the constituents.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct OceanLoading {
    /// A cos φ `[m]`: rows radial, west, south.
    in_phase: [[f64; CONSTITUENTS]; 3],
    /// A sin φ `[m]`: rows radial, west, south.
    quadrature: [[f64; CONSTITUENTS]; 3],
}

impl OceanLoading {
    /// From the rows radial, west and south of a BLQ file: amplitudes `[m]` and phases `[rad]`, which are lags relative
    /// to Greenwich, of M2, S2, N2, K2, K1, O1, P1, Q1, Mf, Mm, Ssa.
    pub fn new(amplitude: &[[f64; CONSTITUENTS]; 3], phase: &[[f64; CONSTITUENTS]; 3]) -> Self {
        let mut loading = Self::default();
        for (k, (amplitudes, phases)) in amplitude.iter().zip(phase).enumerate() {
            for (j, (&amplitude, &phase)) in amplitudes.iter().zip(phases).enumerate() {
                let (sin, cos) = libm::sincos(phase);
                if let Some(value) = loading.in_phase.get_mut(k).and_then(|row| row.get_mut(j)) {
                    *value = amplitude * cos;
                }
                if let Some(value) = loading.quadrature.get_mut(k).and_then(|row| row.get_mut(j)) {
                    *value = amplitude * sin;
                }
            }
        }
        loading
    }

    /// Displacement at a time: east, north, up `[m]`, to be added to the station.
    pub fn displacement(&self, time: GpsTime) -> Vector3<f64> {
        self.displacement_with(&Constituents::at(time))
    }

    /// Displacement, east, north, up `[m]`, with the constituents at a time.
    pub fn displacement_with(&self, constituents: &Constituents) -> Vector3<f64> {
        let component = |in_phase: &[f64; CONSTITUENTS], quadrature: &[f64; CONSTITUENTS]| -> f64 {
            // Re(A e^(−iφ) Σ) of each constituent.
            let pairs = in_phase.iter().zip(quadrature).zip(constituents.real.iter().zip(&constituents.imaginary));
            pairs.map(|((in_phase, quadrature), (real, imaginary))| in_phase * real + quadrature * imaginary).sum()
        };
        let [radial, west, south] = &self.in_phase;
        let [radial_q, west_q, south_q] = &self.quadrature;
        Vector3::new(-component(west, west_q), -component(south, south_q), component(radial, radial_q))
    }
}

/// The constituents at a time, each with the waves that fall to it: Σ_w share · e^(iθ_w), in units of its own
/// amplitude. The same everywhere on the Earth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constituents {
    real: [f64; CONSTITUENTS],
    imaginary: [f64; CONSTITUENTS],
}

impl Constituents {
    /// At a time.
    pub fn at(time: GpsTime) -> Self {
        let arguments = Delaunay::at(terrestrial_centuries(time));
        let s = arguments.latitude_argument + arguments.node;
        let h = s - arguments.elongation;
        let tau = TAU * utc_day(time).1 - arguments.elongation;
        let powers = [s, h, s - arguments.moon_anomaly, -arguments.node, h - arguments.sun_anomaly].map(powers);
        let [a, b, c, d] = band(&SEMIDIURNAL_SHARES, &powers, 2.0 * tau);
        let [e, f, g, i] = band(&DIURNAL_SHARES, &powers, tau + 90.0 * DEGREE);
        let [j, k, l, _] = band(&LONG_PERIOD_SHARES, &powers, 180.0 * DEGREE);
        let all = [a, b, c, d, e, f, g, i, j, k, l];
        Self { real: all.map(|z| z.real), imaginary: all.map(|z| z.imaginary) }
    }
}

#[derive(Clone, Copy)]
struct Complex {
    real: f64,
    imaginary: f64,
}

impl Complex {
    const ONE: Self = Self { real: 1.0, imaginary: 0.0 };

    /// e^(i angle).
    fn turn(angle: f64) -> Self {
        let (imaginary, real) = libm::sincos(angle);
        Self { real, imaginary }
    }

    fn times(self, other: Self) -> Self {
        Self {
            real: self.real * other.real - self.imaginary * other.imaginary,
            imaginary: self.real * other.imaginary + self.imaginary * other.real,
        }
    }
}

/// Largest multiple of an argument in the tables.
const LARGEST_MULTIPLE: usize = 6;

/// e^(i n angle) for n = 0…6.
fn powers(angle: f64) -> [Complex; LARGEST_MULTIPLE + 1] {
    let step = Complex::turn(angle);
    let mut power = Complex::ONE;
    core::array::from_fn(|n| {
        if n > 0 {
            power = power.times(step);
        }
        power
    })
}

/// The sum over the waves of a band for each of its constituents, all turned by `offset` `[rad]`.
fn band(waves: &[Share], powers: &[[Complex; LARGEST_MULTIPLE + 1]; 5], offset: f64) -> [Complex; 4] {
    let mut sums = [Complex { real: 0.0, imaginary: 0.0 }; 4];
    for wave in waves {
        let mut phase = Complex::ONE;
        for (&multiple, powers) in wave.multiples.iter().zip(powers) {
            if multiple == 0 {
                continue;
            }
            let power = powers.get(usize::from(multiple.unsigned_abs())).copied().unwrap_or(Complex::ONE);
            let sign = if multiple < 0 { -1.0 } else { 1.0 };
            phase = phase.times(Complex { real: power.real, imaginary: sign * power.imaginary });
        }
        for (sum, share) in sums.iter_mut().zip(wave.shares) {
            sum.real += f64::from(share) * phase.real;
            sum.imaginary += f64::from(share) * phase.imaginary;
        }
    }
    let offset = Complex::turn(offset);
    sums.map(|sum| sum.times(offset))
}

/// A wave and its shares H_w W_wk / |H_k| in the constituents of its band, of which the long-period band has three.
#[derive(Clone, Copy)]
struct Share {
    multiples: [i8; 5],
    shares: [f32; 4],
}

static SEMIDIURNAL_SHARES: [Share; SEMIDIURNAL.len()] = shares(&SEMIDIURNAL, 2.0, &[2, 0, 1, 3]); // N2 M2 S2 K2
static DIURNAL_SHARES: [Share; DIURNAL.len()] = shares(&DIURNAL, 1.0, &[3, 1, 2, 0]); // Q1 O1 P1 K1
static LONG_PERIOD_SHARES: [Share; LONG_PERIOD.len()] = shares(&LONG_PERIOD, 0.0, &[2, 1, 0]); // Ssa Mm Mf

/// Frequencies of l, l′, F, D, Ω at J2000.0 `[1/d]` (IERS Conventions 2010, eq. 5.43, in cycles).
const DELAUNAY_RATES: [f64; 5] = [0.036_291_647_1, 0.002_737_778_6, 0.036_748_195_1, 0.033_863_192_0, -0.000_147_093_8];

/// Frequency of a wave with `tau` times the lunar day `[1/d]`.
const fn frequency(tau: f64, multiples: &[i8; 5]) -> f64 {
    let [moon_anomaly, sun_anomaly, latitude, elongation, node] = DELAUNAY_RATES;
    let s = latitude + node;
    let h = s - elongation;
    let rates = [s, h, s - moon_anomaly, -node, h - sun_anomaly];
    let mut sum = tau * (1.0 - elongation);
    let mut i = 0;
    while i < 5 {
        sum += multiples[i] as f64 * rates[i];
        i += 1;
    }
    sum
}

/// The shares of all waves of a band; `order` are its constituents (the first of the table) by rising frequency.
/// Runs when compiling.
const fn shares<const N: usize, const K: usize>(waves: &[Wave; N], tau: f64, order: &[usize; K]) -> [Share; N] {
    let mut knots = [0.0; K];
    let mut bases = [[[0.0; K]; 2]; K]; // for each knot: values and second derivatives of its basis function
    let mut k = 0;
    while k < K {
        knots[k] = frequency(tau, &waves[order[k]].1);
        bases[k][0][k] = 1.0;
        k += 1;
    }
    k = 0;
    while k < K {
        bases[k][1] = second_derivatives(&knots, &bases[k][0]);
        k += 1;
    }
    let mut all = [Share { multiples: [0; 5], shares: [0.0; 4] }; N];
    let mut i = 0;
    while i < N {
        all[i].multiples = waves[i].1;
        let at = frequency(tau, &waves[i].1);
        k = 0;
        while k < K {
            let weight = interpolate(&knots, &bases[k][0], &bases[k][1], at);
            let own = waves[order[k]].0;
            let own = if own < 0 { -own } else { own };
            all[i].shares[order[k]] = (weight * waves[i].0 as f64 / own as f64) as f32;
            k += 1;
        }
        i += 1;
    }
    all
}

/// Second derivatives at the knots of the cubic spline through `values` whose end slopes are those of the parabolas
/// through the first and last three; zero, which means straight lines, for fewer than four.
const fn second_derivatives<const K: usize>(knots: &[f64; K], values: &[f64; K]) -> [f64; K] {
    let mut second = [0.0; K];
    if K < 4 {
        return second;
    }
    // Rows: h₋ s₋ + 2 (h₋ + h₊) s + h₊ s₊ = 6 (slope₊ − slope₋), with the end slopes beyond the ends. Thomas'
    // algorithm.
    let (mut diagonal, mut right) = ([0.0; K], [0.0; K]);
    let mut i = 0;
    while i < K {
        let (left_step, left_slope) = if i == 0 {
            (0.0, end_slope([knots[0], knots[1], knots[2]], [values[0], values[1], values[2]]))
        } else {
            step(knots, values, i - 1)
        };
        let (right_step, right_slope) = if i + 1 == K {
            let (x, y) = ([knots[K - 1], knots[K - 2], knots[K - 3]], [values[K - 1], values[K - 2], values[K - 3]]);
            (0.0, end_slope(x, y))
        } else {
            step(knots, values, i)
        };
        diagonal[i] = 2.0 * (left_step + right_step);
        right[i] = 6.0 * (right_slope - left_slope);
        if i > 0 {
            let factor = left_step / diagonal[i - 1];
            diagonal[i] -= factor * left_step;
            right[i] -= factor * right[i - 1];
        }
        i += 1;
    }
    second[K - 1] = right[K - 1] / diagonal[K - 1];
    i = K - 1;
    while i > 0 {
        i -= 1;
        second[i] = (right[i] - step(knots, values, i).0 * second[i + 1]) / diagonal[i];
    }
    second
}

/// Length and slope of the interval after knot `i`.
const fn step<const K: usize>(knots: &[f64; K], values: &[f64; K], i: usize) -> (f64, f64) {
    let length = knots[i + 1] - knots[i];
    (length, (values[i + 1] - values[i]) / length)
}

/// Slope at the first of three points of the parabola through them.
const fn end_slope(x: [f64; 3], y: [f64; 3]) -> f64 {
    let (near, far) = (x[1] - x[0], x[2] - x[0]);
    ((y[1] - y[0]) / near * far - (y[2] - y[0]) / far * near) / (far - near)
}

/// The spline at `at`; the value of the nearest end outside.
const fn interpolate<const K: usize>(knots: &[f64; K], values: &[f64; K], second: &[f64; K], at: f64) -> f64 {
    if at <= knots[0] {
        return values[0];
    }
    let mut i = 0;
    while i + 1 < K {
        let (length, _) = step(knots, values, i);
        if at < knots[i + 1] {
            let (before, after) = (at - knots[i], knots[i + 1] - at);
            let cubic = (second[i] * after * after * after + second[i + 1] * before * before * before) / (6.0 * length);
            return cubic
                + before * (values[i + 1] / length - second[i + 1] * length / 6.0)
                + after * (values[i] / length - second[i] * length / 6.0);
        }
        i += 1;
    }
    values[K - 1]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gnss::time::Calendar;
    use proptest::prelude::*;

    /// Onsala of the test case in the header of HARDISP.F (IERS Conventions 2010): radial, west, south.
    fn onsala() -> OceanLoading {
        let amplitude = [
            [0.00352, 0.00123, 0.0008, 0.00032, 0.00187, 0.00112, 0.00063, 0.00003, 0.00082, 0.00044, 0.00037],
            [0.00144, 0.00035, 0.00035, 0.00008, 0.00053, 0.00049, 0.00018, 0.00009, 0.00012, 0.00005, 0.00006],
            [0.00086, 0.00023, 0.00023, 0.00006, 0.00029, 0.00028, 0.0001, 0.00007, 0.00004, 0.00002, 0.00001],
        ];
        let phase = [
            [-64.7, -52.0, -96.2, -55.2, -58.8, -151.4, -65.6, -138.1, 8.4, 5.2, 2.1],
            [85.5, 114.5, 56.5, 113.6, 99.4, 19.1, 94.1, -10.4, -167.4, -170.0, -177.7],
            [109.5, 147.0, 92.7, 148.8, 50.5, -55.1, 36.4, -170.4, -15.0, 2.3, 5.2],
        ];
        OceanLoading::new(&amplitude, &phase.map(|row: [f64; CONSTITUENTS]| row.map(f64::to_radians)))
    }

    #[test]
    fn agrees_with_the_published_case() {
        // HARDISP.F: 2009-06-25 01:10:45 and 02:10:45 UTC, up, south, west, printed to 1 µm.
        let start = Calendar { hour: 1, minute: 10, second: 45.0, ..Calendar::date(2009, 6, 25) };
        let start = GpsTime::from_utc(&start).unwrap();
        for (hours, expected) in
            [(0.0, [0.003_094, -0.001_538, -0.000_895]), (1.0, [0.001_812, -0.000_950, -0.000_193])]
        {
            let enu = onsala().displacement(start.plus_seconds(3_600.0 * hours));
            for (computed, expected) in [enu.z, -enu.y, -enu.x].into_iter().zip(expected) {
                assert!((computed - expected).abs() < 0.6e-6, "{computed} {expected}");
            }
        }
    }

    #[test]
    fn arguments_agree_with_the_published_case() {
        // TDFRPH.F: M2 on 2009-06-25, 0 h UTC: 1.93227361605688 cycles a day, phase 303.343338720297°.
        let time = GpsTime::from_utc(&Calendar::date(2009, 6, 25)).unwrap();
        let elongation = Delaunay::at(terrestrial_centuries(time)).elongation;
        let phase = (-2.0 * elongation).to_degrees().rem_euclid(360.0);
        assert!((phase - 303.343_338_720_297).abs() < 1e-6, "{phase}");
        assert!((frequency(2.0, &[0; 5]) - 1.932_273_616_056_88).abs() < 1e-9);
    }

    #[test]
    fn tables_are_whole() {
        // Their rule of order: falling amplitude; no wave twice; multiples that the powers cover.
        for (table, count) in [(&SEMIDIURNAL[..], 109), (&DIURNAL[..], 154), (&LONG_PERIOD[..], 79)] {
            assert_eq!(table.len(), count);
            assert!(table.windows(2).all(|pair| pair[0].0.abs() >= pair[1].0.abs()));
            for (i, (_, multiples)) in table.iter().enumerate() {
                assert!(table[..i].iter().all(|(_, other)| other != multiples), "{multiples:?}");
                assert!(multiples.iter().all(|n| usize::from(n.unsigned_abs()) <= LARGEST_MULTIPLE));
            }
        }
    }

    #[test]
    fn shares_add_up_to_the_wave_where_the_admittance_is_flat() {
        // A spline through equal values is constant, so that the weights of each wave sum to 1.
        let check = |waves: &[Wave], shares: &[Share], constituents: usize| {
            for ((amplitude, multiples), share) in waves.iter().zip(shares) {
                let weights = waves.iter().zip(share.shares).take(constituents);
                let sum: f64 = weights.map(|(own, share)| f64::from(share) * f64::from(own.0.abs())).sum();
                assert!((sum / f64::from(*amplitude) - 1.0).abs() < 1e-5, "{multiples:?} {sum}");
            }
        };
        check(&SEMIDIURNAL, &SEMIDIURNAL_SHARES, 4);
        check(&DIURNAL, &DIURNAL_SHARES, 4);
        check(&LONG_PERIOD, &LONG_PERIOD_SHARES, 3);
    }

    #[test]
    fn splines_reproduce_parabolas() {
        // End slopes from parabolas: a parabola comes back, for any spacing.
        let knots = [0.0, 1.0, 2.5, 3.0];
        let values = knots.map(|x| 1.0 - 2.0 * x + 0.5 * x * x);
        let second = second_derivatives(&knots, &values);
        assert!(second.iter().all(|s| (s - 1.0).abs() < 1e-12), "{second:?}");
        assert!((interpolate(&knots, &values, &second, 1.7) - (1.0 - 3.4 + 0.5 * 2.89)).abs() < 1e-12);
        assert_eq!(interpolate(&knots, &values, &second, 9.0), values[3]);
        assert_eq!(interpolate(&knots, &values, &second, -9.0), values[0]);
    }

    proptest! {
        #[test]
        fn is_linear_in_the_response_and_slow(seconds in 0.0..1e9f64, factor in -3.0..3.0f64) {
            let time = GpsTime::from_week_tow(1_000, seconds);
            let constituents = Constituents::at(time);
            let once = onsala().displacement_with(&constituents);
            let OceanLoading { in_phase, quadrature } = onsala();
            let scaled = OceanLoading {
                in_phase: in_phase.map(|row| row.map(|value| factor * value)),
                quadrature: quadrature.map(|row| row.map(|value| factor * value)),
            };
            prop_assert!((scaled.displacement_with(&constituents) - once * factor).amax() < 1e-15);
            prop_assert!(once.norm() < 0.02);
            prop_assert!((onsala().displacement(time.plus_seconds(1.0)) - once).norm() < 15e-6);
        }

        #[test]
        fn takes_anything(ns: i64) {
            let enu = onsala().displacement(GpsTime::from_nanoseconds(ns));
            prop_assert!(enu.norm() < 0.05);
        }
    }
}
