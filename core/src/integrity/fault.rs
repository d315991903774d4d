//! A fault of one satellite in one epoch: whether there is one, whose it is, and how far it may have gone unnoticed.
//!
//! Measurements of several satellites in one or more groups with a free common term each (the receiver clock),
//! ```text
//! yᵢ = c_g(i) + gᵢ·δ + eᵢ,   eᵢ ~ N(0, σᵢ²) independent          → δ̂, P = N⁻¹, χ² = Σ vᵢ²/σᵢ²
//! ```
//! are solved by weighted least squares, and again without each satellite s (all its rows): δ̂_(s), P_(s). The separation
//! d_s = δ̂ − δ̂_(s) is N(0, P_(s) − P) without a fault (solution separation: R. G. Brown & P. W. McBurney, *Navigation* 35
//! (1988) 41–53; J. Blanch et al., *Baseline advanced RAIM user algorithm*, IEEE Trans. AES 51 (2015) 713–732, eqs. 20 to
//! 26):
//! ```text
//! T_s = K_fa √(P_(s) − P)     K_fa = Q⁻¹(½ · ½P_fa/2n)     alarm if |d_s| > T_s, or if P(χ² > that found) < ½P_fa
//! PL_s = T_s + K_md √P_(s)    K_md = Q⁻¹(½P_md)
//! ```
//! for the vertical, and for the horizontal with the traces of the two-by-two blocks, where one dimension's K is never too
//! small ([`super::risk`]). Half of the false alarms are left to χ², which sees faults of more than one satellite, half are
//! divided between the 2n tests of n satellites, so that P(alarm | no fault) ≤ P_fa. Given a fault of any size in s, an error
//! beyond PL_s without an alarm needs |δ̂_(s)'s error| > K_md √P_(s): its probability is at most P_md for each component.
//!
//! On an alarm the satellite is excluded whose absence leaves the most likely χ², if that of the rest passes.
//!
//! Removing row i with weight w of a group of weight W changes the normal matrix by −w' v vᵀ with v = gᵢ − ḡ and
//! w' = wW/(W − w): each δ̂_(s) is one rank-one downdate for each of its rows. Cost: O(n rows), some hundred operations a
//! satellite; memory: 16 groups of five numbers. No panics.

use crate::filter::screen::{MAX_GROUPS, Row};
use crate::stats::{chi_square, normal};
use nalgebra::{Matrix3, Vector3};

/// A satellite without which the rest has less than this part of the information in some direction cannot be done without.
const LEAST_REST: f64 = 1e-9;

/// Whether and how faults are looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct Config {
    /// Probability, for each epoch without a fault, of an alarm.
    pub p_fa: f64,
    /// Probability, given a fault of one satellite, that a component's error exceeds the protection level without an alarm.
    pub p_md: f64,
    /// Whether they are.
    pub enabled: bool,
}

impl Config {
    /// The default: 1e-5 and 1e-3 (P_fa of a false alarm in 28 hours at 1 Hz; P_md that, with a fault in 1e4 epochs, is the
    /// default integrity risk of 1e-7), and on, because without it levels are exceeded on real drives:
    ///
    /// | | PE > PL, H and V, off | on | fixed, off | on | median HPL, off | on |
    /// |---|---|---|---|---|---|---|
    /// | car, and the same as moving base | 0.21 %, 0 | 0, 0 | 98.94 % | 98.94 % | 2.8 cm | 3.2 cm |
    /// | the car in three simulated cities | 0.24 %, 0.02 % | 0, 0 | 97.51 % | 97.46 % | 2.9 cm | 3.4 cm |
    /// | van at rest among trees | 0, 0.18 % | 0, 0 | 97.34 % | 97.34 % | 3.7 cm | 8.8 cm |
    /// | van among trees | 0.32 %, 0.16 % | 0, 0 | 48.89 % | 48.79 % | 73.7 cm | 74.6 cm |
    ///
    /// On three static baselines nothing is exceeded with or without. In the last row the rms of fixed epochs grows from 1.87
    /// to 1.89 cm: what was left out was not always wrong.
    pub const DEFAULT: Self = Self { p_fa: 1e-5, p_md: 1e-3, enabled: true };

    /// Whether both are probabilities above 0 and below 1.
    pub fn is_sound(&self) -> bool {
        [self.p_fa, self.p_md].iter().all(|p| *p > 0.0 && *p < 1.0)
    }
}

impl Default for Config {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// What an examination ended with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// No alarm.
    Clear,
    /// An alarm that the exclusion of this satellite explains.
    Excluded(u8),
    /// An alarm that the exclusion of no satellite explains.
    Unresolved,
    /// Too few measurements to check anything.
    Unchecked,
}

/// What an examination found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Examination {
    /// How it ended.
    pub verdict: Verdict,
    /// δ̂, without the satellite excluded: in the axes of the gradients, east, north, up `[m]`.
    pub delta: Vector3<f64>,
    /// Its covariance `[m²]`.
    pub covariance: Matrix3<f64>,
    /// χ² of it.
    pub chi_square: f64,
    /// Its degrees of freedom.
    pub degrees_of_freedom: u32,
    /// Largest PL_s of the satellites used, horizontal and vertical `[m]`; infinite where the position depends on one
    /// satellite alone.
    pub levels: [f64; 2],
}

/// A least-squares solution.
#[derive(Clone, Copy)]
struct Fit {
    delta: Vector3<f64>,
    covariance: Matrix3<f64>,
    chi_square: f64,
    degrees_of_freedom: u32,
}

/// The rows of one group.
#[derive(Clone, Copy)]
struct Group {
    weight: f64,
    count: u32,
    gradient: Vector3<f64>,
    value: f64,
}

/// Examines the rows that are not excluded; `of` names the satellite of each, which has one row at most in a group. `None`
/// where they determine no position, or where a number makes no sense.
pub fn examine(rows: &[Row], of: &[u8], config: &Config) -> Option<Examination> {
    if !config.is_sound() || rows.len() != of.len() {
        return None;
    }
    let snapshot = Snapshot::new(rows, of, None)?;
    let fit = snapshot.fit?;
    let (levels, separated) = snapshot.separations(&fit, config)?;
    let ended = |verdict, fit: Fit, levels| Examination {
        verdict,
        delta: fit.delta,
        covariance: fit.covariance,
        chi_square: fit.chi_square,
        degrees_of_freedom: fit.degrees_of_freedom,
        levels,
    };
    if fit.degrees_of_freedom == 0 {
        return Some(ended(Verdict::Unchecked, fit, [f64::INFINITY; 2]));
    }
    if !separated && passes(&fit, config) {
        return Some(ended(Verdict::Clear, fit, levels));
    }
    let mut best: Option<(u8, f64)> = None;
    for satellite in snapshot.satellites() {
        let Some(rest) = snapshot.without(&fit, satellite).filter(|rest| rest.degrees_of_freedom > 0) else { continue };
        let likelihood = chi_square::survival(rest.chi_square, rest.degrees_of_freedom);
        if passes(&rest, config) && best.is_none_or(|(_, most)| likelihood > most) {
            best = Some((satellite, likelihood));
        }
    }
    let excluded = best.and_then(|(satellite, _)| {
        let rest = Snapshot::new(rows, of, Some(satellite))?;
        let fit = rest.fit?;
        Some(ended(Verdict::Excluded(satellite), fit, rest.separations(&fit, config)?.0))
    });
    Some(excluded.unwrap_or(ended(Verdict::Unresolved, fit, levels)))
}

/// Whether χ² is no alarm.
fn passes(fit: &Fit, config: &Config) -> bool {
    chi_square::survival(fit.chi_square.max(0.0), fit.degrees_of_freedom) >= 0.5 * config.p_fa
}

/// The measurements of an epoch, without those of a satellite.
struct Snapshot<'a> {
    rows: &'a [Row],
    of: &'a [u8],
    without: Option<u8>,
    groups: [Group; MAX_GROUPS],
    fit: Option<Fit>,
}

impl<'a> Snapshot<'a> {
    /// `None` if a number makes no sense.
    fn new(rows: &'a [Row], of: &'a [u8], without: Option<u8>) -> Option<Self> {
        let none = Group { weight: 0.0, count: 0, gradient: Vector3::zeros(), value: 0.0 };
        let mut snapshot = Self { rows, of, without, groups: [none; MAX_GROUPS], fit: None };
        let mut count = 0;
        for (row, _) in Self::used(rows, of, without) {
            let group = snapshot.groups.get_mut(row.group)?;
            if !(row.variance > 0.0 && row.variance.is_finite() && row.innovation.is_finite()) {
                return None;
            }
            group.weight += 1.0 / row.variance;
            group.count += 1;
            let part = 1.0 / (row.variance * group.weight);
            group.gradient += (row.gradient - group.gradient) * part;
            group.value += (row.innovation - group.value) * part;
            count += 1;
        }
        let unknowns = 3 + snapshot.groups.iter().filter(|group| group.count > 0).count() as u32;
        let (mut normal, mut right, mut squares) = (Matrix3::zeros(), Vector3::zeros(), 0.0);
        for (row, _) in Self::used(rows, of, without) {
            let (gradient, value) = snapshot.reduced(row)?;
            normal += gradient * gradient.transpose() / row.variance;
            right += gradient * (value / row.variance);
            squares += value * value / row.variance;
        }
        if count >= unknowns
            && let Some(covariance) = normal.try_inverse()
        {
            let delta = covariance * right;
            let fit = Fit {
                delta,
                covariance,
                chi_square: squares - right.dot(&delta),
                degrees_of_freedom: count - unknowns,
            };
            let positive = (0..3).all(|i| covariance[(i, i)] > 0.0);
            let sound = positive
                && fit.chi_square.is_finite()
                && fit.delta.iter().chain(covariance.iter()).all(|x| x.is_finite());
            snapshot.fit = sound.then_some(fit);
        }
        Some(snapshot)
    }

    fn used(rows: &'a [Row], of: &'a [u8], without: Option<u8>) -> impl Iterator<Item = (&'a Row, u8)> {
        let all = rows.iter().zip(of.iter().copied());
        all.filter(move |(row, satellite)| !row.excluded && Some(*satellite) != without)
    }

    /// gᵢ − ḡ and yᵢ − ȳ.
    fn reduced(&self, row: &Row) -> Option<(Vector3<f64>, f64)> {
        let group = self.groups.get(row.group)?;
        Some((row.gradient - group.gradient, row.innovation - group.value))
    }

    /// Each satellite once.
    fn satellites(&self) -> impl Iterator<Item = u8> {
        let used = || Self::used(self.rows, self.of, self.without).map(|(_, satellite)| satellite);
        used()
            .enumerate()
            .filter(move |(i, satellite)| !used().take(*i).any(|other| other == *satellite))
            .map(|(_, s)| s)
    }

    /// The solution without one more satellite; `None` if there is none.
    fn without(&self, fit: &Fit, satellite: u8) -> Option<Fit> {
        let Fit { mut delta, mut covariance, mut chi_square, mut degrees_of_freedom } = *fit;
        // A satellite has one row in a group: what a removal does to the mean concerns no other row of it.
        for (row, _) in Self::used(self.rows, self.of, self.without).filter(|(_, other)| *other == satellite) {
            let group = self.groups.get(row.group)?;
            if group.count < 2 {
                // Its common term goes with it.
                continue;
            }
            let (v, u) = self.reduced(row)?;
            let w = 1.0 / row.variance;
            let weight = w * group.weight / (group.weight - w);
            let gain = covariance * v;
            let rest = 1.0 - weight * v.dot(&gain);
            degrees_of_freedom = degrees_of_freedom.checked_sub(1)?;
            if !(rest > LEAST_REST && weight.is_finite()) {
                return None;
            }
            let residual = u - v.dot(&delta);
            delta -= gain * (weight * residual / rest);
            chi_square -= weight * residual * residual / rest;
            covariance += gain * gain.transpose() * (weight / rest);
        }
        Some(Fit { delta, covariance, chi_square, degrees_of_freedom })
    }

    /// The largest PL_s, and whether a separation is an alarm.
    fn separations(&self, fit: &Fit, config: &Config) -> Option<([f64; 2], bool)> {
        let tests = 2.0 * self.satellites().count() as f64;
        let allowed = normal::upper_quantile(0.25 * config.p_fa / tests);
        let missed = normal::upper_quantile(0.5 * config.p_md);
        let (mut levels, mut separated) = ([0.0_f64; 2], false);
        for satellite in self.satellites() {
            let Some(rest) = self.without(fit, satellite) else {
                levels = [f64::INFINITY; 2];
                continue;
            };
            let (apart, spread) = (fit.delta - rest.delta, rest.covariance - fit.covariance);
            let deviations = |covariance: &Matrix3<f64>| {
                let variances = [covariance[(0, 0)] + covariance[(1, 1)], covariance[(2, 2)]];
                variances.map(|variance| libm::sqrt(variance.max(0.0)))
            };
            let separations = [libm::hypot(apart.x, apart.y), libm::fabs(apart.z)];
            let terms = deviations(&spread).into_iter().zip(deviations(&rest.covariance)).zip(separations);
            for (level, ((spread, sigma), separation)) in levels.iter_mut().zip(terms) {
                let threshold = allowed * spread;
                separated |= separation > threshold;
                *level = level.max(threshold + missed * sigma);
            }
        }
        levels.iter().all(|level| !level.is_nan()).then_some((levels, separated))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Standard normal numbers: SplitMix64 (Steele, Lea & Flood 2014), Box & Muller (1958).
    struct Noise(u64);

    impl Noise {
        fn uniform(&mut self) -> f64 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            (((z ^ (z >> 31)) >> 11) as f64 + 0.5) / (1u64 << 53) as f64
        }

        fn normal(&mut self) -> f64 {
            (-2.0 * self.uniform().ln()).sqrt() * (2.0 * core::f64::consts::PI * self.uniform()).cos()
        }
    }

    /// Azimuth and elevation `[deg]` of eight satellites, on two bands, and of three more of another constellation.
    const SKY: [(f64, f64); 11] = [
        (10.0, 75.0),
        (60.0, 30.0),
        (120.0, 45.0),
        (170.0, 20.0),
        (215.0, 60.0),
        (260.0, 25.0),
        (300.0, 40.0),
        (340.0, 15.0),
        (35.0, 50.0),
        (145.0, 65.0),
        (285.0, 35.0),
    ];

    /// Rows of 4 mm at the zenith, 4 mm/sin E below.
    fn sky() -> (Vec<Row>, Vec<u8>) {
        let (mut rows, mut of) = (Vec::new(), Vec::new());
        for (i, (azimuth, elevation)) in SKY.into_iter().enumerate() {
            let (azimuth, elevation) = (f64::to_radians(azimuth), f64::to_radians(elevation));
            let plane = elevation.cos();
            let gradient = -Vector3::new(plane * azimuth.sin(), plane * azimuth.cos(), elevation.sin());
            let sigma = 0.004 / elevation.sin();
            for band in 0..2 {
                let group = if i < 8 { band } else { 2 + band };
                rows.push(Row {
                    gradient,
                    group,
                    innovation: 0.0,
                    variance: sigma * sigma,
                    excluded: false,
                    error: 0.0,
                });
                of.push(i as u8);
            }
        }
        (rows, of)
    }

    /// Noise, clocks of metres, a position of metres.
    fn measure(rows: &mut [Row], noise: &mut Noise, place: &Vector3<f64>) {
        for row in rows {
            let clock = 3.0 - row.group as f64;
            row.innovation = clock + row.gradient.dot(place) + row.variance.sqrt() * noise.normal();
        }
    }

    /// Half-width of the 95 % interval of a rate: 1.96 √(p(1−p)/n).
    fn half_width(p: f64, n: u32) -> f64 {
        1.96 * (p * (1.0 - p) / f64::from(n)).sqrt()
    }

    const PLACE: Vector3<f64> = Vector3::new(1.0, -2.0, 0.5);

    /// Downdates are least squares without the satellite, to rounding.
    #[test]
    fn a_downdate_is_a_solution_of_the_rest() {
        let (mut rows, of) = sky();
        measure(&mut rows, &mut Noise(7), &PLACE);
        let snapshot = Snapshot::new(&rows, &of, None).unwrap();
        let fit = snapshot.fit.unwrap();
        // 22 rows, four clocks, three coordinates.
        assert_eq!((fit.degrees_of_freedom, snapshot.satellites().count()), (15, 11));
        for satellite in 0..11 {
            let downdated = snapshot.without(&fit, satellite).unwrap();
            let rest = Snapshot::new(&rows, &of, Some(satellite)).unwrap().fit.unwrap();
            assert!((downdated.delta - rest.delta).norm() < 1e-12);
            assert!((downdated.covariance - rest.covariance).norm() < 1e-9 * rest.covariance.norm());
            assert!((downdated.chi_square - rest.chi_square).abs() < 1e-8);
            assert_eq!((downdated.degrees_of_freedom, rest.degrees_of_freedom), (13, 13));
        }
    }

    /// P_fa = 1e-2, 40 000 epochs: half of it are alarms of χ², exactly; all alarms are at most P_fa. A fault-free test of one
    /// satellite's separation up is an alarm in ½P_fa/2n of the epochs: both within 95 % intervals.
    #[test]
    fn false_alarms_are_as_rare_as_stated() {
        let config = Config { p_fa: 1e-2, p_md: 1e-2, enabled: true };
        let ((mut rows, of), mut noise, epochs) = (sky(), Noise(1), 40_000);
        let (mut alarms, mut squares, mut up, mut levels) = (0, 0, 0, None);
        // ½ · 1e-2 for 22 tests, two-sided.
        let allowed = normal::upper_quantile(0.5 * 0.5 * 1e-2 / 22.0);
        for _ in 0..epochs {
            measure(&mut rows, &mut noise, &PLACE);
            let snapshot = Snapshot::new(&rows, &of, None).unwrap();
            let fit = snapshot.fit.unwrap();
            let found = examine(&rows, &of, &config).unwrap();
            alarms += u32::from(found.verdict != Verdict::Clear);
            squares += u32::from(!passes(&fit, &config));
            for satellite in 0..11 {
                let rest = snapshot.without(&fit, satellite).unwrap();
                let spread = (rest.covariance - fit.covariance)[(2, 2)].sqrt();
                up += u32::from((rest.delta - fit.delta).z.abs() > allowed * spread);
            }
            if found.verdict == Verdict::Clear {
                // Levels are of the geometry alone.
                assert!(
                    levels
                        .get_or_insert(found.levels)
                        .iter()
                        .zip(found.levels)
                        .all(|(a, b)| (a / b - 1.0).abs() < 1e-9)
                );
            }
        }
        let rate = |count: u32| f64::from(count) / f64::from(epochs);
        println!("alarms {:.5}, by chi-square {:.5}, by a separation up {:.6}", rate(alarms), rate(squares), rate(up));
        assert!((rate(squares) - 5e-3).abs() < half_width(5e-3, epochs), "{}", rate(squares));
        assert!(rate(alarms) < 1e-2 + half_width(1e-2, epochs) && alarms >= squares, "{}", rate(alarms));
        // Eleven tests, a quarter of P_fa in all.
        assert!((rate(up) - 2.5e-3).abs() < half_width(2.5e-3, epochs), "{}", rate(up));
    }

    /// P_md = 1e-2, a fault of each size in each of four satellites, 10 000 epochs each: an error beyond the satellite's level
    /// without an alarm is no more frequent than stated.
    #[test]
    fn missed_detections_are_as_rare_as_stated() {
        let config = Config { p_fa: 1e-2, p_md: 1e-2, enabled: true };
        let ((mut rows, of), mut noise, epochs) = (sky(), Noise(2), 10_000);
        let mut most = [0.0_f64; 2];
        for victim in [0, 3, 4, 7] {
            for size in [0.01, 0.02, 0.03, 0.05, 0.08] {
                let mut missed = [0u32; 2];
                for _ in 0..epochs {
                    measure(&mut rows, &mut noise, &PLACE);
                    for (row, _) in rows.iter_mut().zip(&of).filter(|(_, satellite)| **satellite == victim) {
                        row.innovation += size;
                    }
                    let found = examine(&rows, &of, &config).unwrap();
                    if found.verdict == Verdict::Clear {
                        let error = found.delta - PLACE;
                        missed[0] += u32::from(error.xy().norm() > found.levels[0]);
                        missed[1] += u32::from(error.z.abs() > found.levels[1]);
                    }
                }
                for (most, missed) in most.iter_mut().zip(missed) {
                    *most = most.max(f64::from(missed) / f64::from(epochs));
                }
            }
        }
        println!("missed at most {most:?} of 1e-2");
        assert!(most.iter().all(|rate| *rate < 1e-2 + half_width(1e-2, epochs)), "{most:?}");
    }

    /// What bounds the missed detections: the solution without the faulty satellite is beyond K_md σ in P_md of the epochs.
    #[test]
    fn the_rest_errs_as_its_covariance_says() {
        let ((mut rows, of), mut noise, epochs) = (sky(), Noise(3), 40_000);
        let missed = normal::upper_quantile(0.5 * 1e-2);
        let mut beyond = 0;
        for _ in 0..epochs {
            measure(&mut rows, &mut noise, &PLACE);
            let snapshot = Snapshot::new(&rows, &of, None).unwrap();
            let rest = snapshot.without(&snapshot.fit.unwrap(), 3).unwrap();
            beyond += u32::from((rest.delta - PLACE).z.abs() > missed * rest.covariance[(2, 2)].sqrt());
        }
        let rate = f64::from(beyond) / f64::from(epochs);
        assert!((rate - 1e-2).abs() < half_width(1e-2, epochs), "{rate}");
    }

    /// 5 cm at 2 mm/sin E, in turn on each satellite: found and excluded, and the rest is right to its own noise.
    #[test]
    fn five_centimetres_are_found() {
        let config = Config { enabled: true, ..Config::DEFAULT };
        let ((mut rows, of), mut noise, mut large) = (sky(), Noise(4), 0);
        rows.iter_mut().for_each(|row| row.variance *= 0.25);
        for victim in 0..11 {
            measure(&mut rows, &mut noise, &PLACE);
            for (row, _) in rows.iter_mut().zip(&of).filter(|(_, satellite)| **satellite == victim) {
                row.innovation += 0.05;
            }
            let found = examine(&rows, &of, &config).unwrap();
            // χ² has 15 degrees of freedom and exceeds 49.9 in ½ · 1e-5 of the epochs. With the fault it is 15 + λ ± √(30 + 4λ),
            // λ what the fault alone makes of it: from 100 on it is found in all but one of a thousand epochs.
            let mut fault = rows.clone();
            for (row, satellite) in fault.iter_mut().zip(&of) {
                row.innovation = if *satellite == victim { 0.05 } else { 0.0 };
            }
            if Snapshot::new(&fault, &of, None).unwrap().fit.unwrap().chi_square > 100.0 {
                large += 1;
                assert_eq!(found.verdict, Verdict::Excluded(victim));
                assert!((found.delta - PLACE).norm() < 5.0 * found.covariance.trace().sqrt(), "{victim}");
                assert_eq!(found.degrees_of_freedom, 13);
            }
        }
        assert!(large >= 4, "{large}");
    }

    #[test]
    fn what_cannot_be_checked_is_said_so() {
        let config = Config { enabled: true, ..Config::DEFAULT };
        let (rows, of) = sky();
        // Four satellites on one band: nothing to spare.
        let four: Vec<Row> = rows.iter().step_by(2).take(4).copied().collect();
        let found = examine(&four, &[0, 1, 2, 3], &config).unwrap();
        assert_eq!((found.verdict, found.levels), (Verdict::Unchecked, [f64::INFINITY; 2]));
        assert_eq!(examine(&four[..3], &[0, 1, 2], &config), None);
        assert_eq!(examine(&[], &[], &config), None);
        assert_eq!(examine(&rows, &of, &Config { p_fa: 0.0, ..config }), None);
        // Faults of two satellites: no exclusion of one explains them.
        let (mut rows, of) = sky();
        for (row, satellite) in rows.iter_mut().zip(&of) {
            row.innovation += if [1, 6].contains(satellite) { 0.3 } else { 0.0 };
        }
        assert_eq!(examine(&rows, &of, &config).unwrap().verdict, Verdict::Unresolved);
    }

    proptest! {
        /// Any numbers whatever give finite answers or none.
        #[test]
        fn it_is_total(values in prop::collection::vec(any::<f64>(), 60), of in prop::collection::vec(0u8..9, 12), groups in prop::collection::vec(0usize..20, 12), p in any::<f64>()) {
            let rows: Vec<Row> = values.chunks(5).zip(&groups).map(|(v, &group)| Row {
                gradient: Vector3::new(v[0], v[1], v[2]), group, innovation: v[3], variance: v[4], excluded: false, error: 0.0,
            }).collect();
            if let Some(found) = examine(&rows, &of, &Config { p_fa: p, ..Config::DEFAULT }) {
                prop_assert!(found.delta.iter().all(|x| x.is_finite()) && found.levels.iter().all(|x| !x.is_nan()));
            }
        }
    }
}
