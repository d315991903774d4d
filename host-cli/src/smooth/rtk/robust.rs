//! How far each measurement is to be trusted: noise with heavy tails.
//!
//! In town a few reflected or bent signals are wrong by many standard deviations, for some seconds at a time. A Gaussian
//! model answers with a large variance for all. Here the variance of a signal is R/u over a window of L seconds,
//! u ~ Γ(ν/2, ν/2), so that n errors with the sum of squares S (over R) are multivariate Student-t:
//! ```text
//! ln p = ln Γ((ν + n)/2) − ln Γ(ν/2) − n/2 ln(π ν s) − (ν + n)/2 ln(1 + S/(ν s)),     E[u | e] = (ν + n)/(ν + S/s)
//! ```
//! K. Lange, R. Little & J. Taylor, *Robust statistical modeling using the t distribution*, J. Am. Stat. Assoc. 84 (1989),
//! eqs. (2) and (5). ν, L and the scale s are those of the largest likelihood of the smoothed errors, for each group and
//! type; good data choose ν = ∞, where all u are 1. The rest of a step of EM is that of [`crate::smooth::em`], with R/u.
//! (The errors are those of the white parts, smoothed; what lasts is in the coloured ones.)
//!
//! Cost: a forward and a backward pass, and 24 bytes for each link. No panics.

use super::model::RtkModel;
use super::noise::{Kind, Noise};
use super::report::Tail;
use crate::smooth::pass::{PassError, Passes};

/// Degrees of freedom among which the likelihood chooses; none stands for infinitely many.
const FREEDOMS: [f64; 6] = [2.0, 3.0, 5.0, 8.0, 15.0, 40.0];
/// Lengths of windows among which it chooses `[s]`; the first is a single epoch.
const WINDOWS: [f64; 4] = [0.0, 5.0, 20.0, 60.0];
/// Measurements with less than this are counted as distrusted.
const DISTRUSTED: f64 = 0.25;
/// Iterations for the scale.
const ITERATIONS: usize = 12;

/// A number for each measurement: code, phase and Doppler of each link, in the order of the tape.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PerMeasurement(Vec<[f32; 3]>);

impl PerMeasurement {
    /// The same number for all.
    pub fn new(links: usize, value: f32) -> Self {
        Self(vec![[value; 3]; links])
    }

    /// That of a measurement.
    pub fn get(&self, link: usize, kind: Kind) -> f64 {
        f64::from(self.0[link][kind as usize])
    }

    /// Sets that of a measurement.
    pub fn set(&mut self, link: usize, kind: Kind, value: f64) {
        self.0[link][kind as usize] = value as f32;
    }
}

/// A choice of the likelihood for a group and type.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Choice {
    /// ν; infinite for Gaussian noise.
    freedom: f64,
    /// L `[s]`, 0 for single epochs.
    window: f64,
    /// s: R has to be multiplied by it.
    scale: f64,
    /// ln likelihood beyond that of Gaussian noise of the same data.
    gain: f64,
}

impl Choice {
    /// E[u] of a window.
    fn trust(&self, n: f64, s: f64) -> f64 {
        if self.freedom.is_finite() { (self.freedom + n) / (self.freedom + s / self.scale) } else { 1.0 }
    }
}

/// n and S of the windows of one group and type.
#[derive(Clone, Debug, Default)]
struct Windows(Vec<(f64, f64)>);

impl Windows {
    fn total(&self) -> (f64, f64) {
        self.0.iter().fold((0.0, 0.0), |(n, s), window| (n + window.0, s + window.1))
    }

    /// ln likelihood without what is common to all ν, and s, for ν degrees of freedom.
    fn student(&self, nu: f64) -> (f64, f64) {
        let (count, sum) = self.total();
        let mut scale = sum / count;
        for _ in 0..ITERATIONS {
            let weighted: f64 = self.0.iter().map(|&(n, s)| (nu + n) / (nu + s / scale) * s).sum();
            scale = (weighted / count).max(f64::MIN_POSITIVE);
        }
        let gamma = |x: f64| libm::lgamma(0.5 * x);
        let terms = self.0.iter().map(|&(n, s)| {
            gamma(nu + n) - gamma(nu) - 0.5 * n * (0.5 * nu * scale).ln() - 0.5 * (nu + n) * (s / (nu * scale)).ln_1p()
        });
        (terms.sum(), scale)
    }

    /// The same for Gaussian noise.
    fn gaussian(&self) -> (f64, f64) {
        let (count, sum) = self.total();
        let scale = sum / count;
        (-0.5 * count * (1.0 + scale.ln()), scale)
    }

    fn best(&self, window: f64) -> Choice {
        let (gaussian, scale) = self.gaussian();
        let mut best = Choice { freedom: f64::INFINITY, window, scale, gain: 0.0 };
        for freedom in FREEDOMS {
            let (likelihood, scale) = self.student(freedom);
            if likelihood - gaussian > best.gain {
                best = Choice { freedom, window, scale, gain: likelihood - gaussian };
            }
        }
        best
    }
}

/// Walks the windows of length L of a group and type: calls `close` with n, S and the links of each.
fn windows(
    model: &RtkModel<'_>,
    squares: &PerMeasurement,
    kind: Kind,
    group: usize,
    length: f64,
    mut close: impl FnMut(f64, f64, &[usize]),
) {
    let tape = model.tape();
    let mut open: Vec<(i64, f64, Vec<usize>)> = vec![(0, 0.0, Vec::new()); tape.signals().len()];
    let Some(start) = tape.epochs().first().map(|epoch| epoch.time) else { return };
    for (k, epoch) in tape.epochs().iter().enumerate() {
        let number = if length > 0.0 { (epoch.time.since(start) / length) as i64 } else { k as i64 };
        for (link, at) in tape.links(k).iter().zip(tape.first_link(k)..) {
            let square = squares.get(at, kind);
            let of_group = kind == Kind::Doppler || tape.signals()[usize::from(link.signal)].group == group;
            if square.is_nan() || !of_group {
                continue;
            }
            let (window, sum, links) = &mut open[usize::from(link.signal)];
            if *window != number && !links.is_empty() {
                close(links.len() as f64, *sum, links);
                *sum = 0.0;
                links.clear();
            }
            *window = number;
            *sum += square;
            links.push(at);
        }
    }
    for (_, sum, links) in open.iter().filter(|(_, _, links)| !links.is_empty()) {
        close(links.len() as f64, *sum, links);
    }
}

/// Judges all measurements of a model by their smoothed errors; returns how far each is to be trusted, and what was chosen.
pub fn judge(model: &RtkModel<'_>, passes: &mut Passes<'_>) -> Result<(PerMeasurement, Vec<Tail>), PassError> {
    let links = model.tape().link_count();
    let mut squares = PerMeasurement::new(links, f32::NAN);
    passes.forward(model)?;
    passes.backward(model, |epoch| {
        // E[e²]/R
        model.each_residual(epoch.k, epoch.smoothed, |kind, _, row, square| {
            squares.set(row.link, kind, square / (row.variance * row.trust));
        });
    })?;
    let mut trust = PerMeasurement::new(links, 1.0);
    let mut tails = Vec::new();
    for kind in Kind::ALL {
        for group in 0..model.groups(kind) {
            let choices = WINDOWS.into_iter().filter_map(|length| {
                let mut list = Windows::default();
                windows(model, &squares, kind, group, length, |n, s, _| list.0.push((n, s)));
                (list.total().1 > 0.0).then(|| list.best(length))
            });
            let Some(choice) = choices.max_by(|a, b| a.gain.total_cmp(&b.gain)) else { continue };
            let (mut count, mut distrusted) = (0, 0);
            windows(model, &squares, kind, group, choice.window, |n, s, links| {
                let u = choice.trust(n, s);
                count += links.len();
                distrusted += if u < DISTRUSTED { links.len() } else { 0 };
                links.iter().for_each(|&link| trust.set(link, kind, u));
            });
            tails.push(Tail {
                of: Noise::describe(kind, model.tape(), group),
                freedom: choice.freedom.is_finite().then_some(choice.freedom),
                window_s: choice.window,
                count,
                distrusted,
            });
        }
    }
    Ok((trust, tails))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand::distr::Distribution;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{ChiSquared, Gamma};

    /// Windows of n errors with variance R/u, u ~ Γ(ν/2, ν/2), or 1.
    fn sample(freedom: Option<f64>, variance: f64, n: f64, seed: u64) -> Windows {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let chi = ChiSquared::new(n).unwrap();
        let mut window = || {
            let u = freedom.map_or(1.0, |nu| Gamma::new(0.5 * nu, 2.0 / nu).unwrap().sample(&mut random));
            (n, variance * chi.sample(&mut random) / u)
        };
        Windows((0..4000).map(|_| window()).collect())
    }

    /// Drawn with a known ν and scale: the likelihood chooses that ν or its neighbour in the list, and the scale within
    /// 5 %, thrice its standard deviation for 4000 windows.
    #[test]
    fn the_likelihood_finds_the_tail_that_the_errors_were_drawn_with() {
        for (truth, n, seed) in [(3.0, 1.0, 1), (3.0, 10.0, 2), (8.0, 10.0, 3), (15.0, 30.0, 4)] {
            let choice = sample(Some(truth), 2.5, n, seed).best(0.0);
            let at = |nu: f64| FREEDOMS.iter().position(|&f| f == nu).unwrap();
            assert!(at(choice.freedom).abs_diff(at(truth)) <= 1, "{truth} {n}: {choice:?}");
            assert!((choice.scale / 2.5 - 1.0).abs() < 0.05 || at(choice.freedom) != at(truth), "{choice:?}");
            assert!(choice.gain > 10.0, "{choice:?}");
        }
        let gaussian = sample(None, 2.5, 10.0, 5).best(0.0);
        assert_eq!((gaussian.freedom, gaussian.trust(10.0, 1e9)), (f64::INFINITY, 1.0));
        assert!((gaussian.scale / 2.5 - 1.0).abs() < 0.03, "{gaussian:?}");
    }

    #[test]
    fn of_equal_errors_none_is_distrusted_and_one_large_one_is() {
        let mut list: Vec<(f64, f64)> = (0..200).map(|i| (5.0, 4.0 + f64::from(i % 5) * 0.5)).collect();
        assert!(Windows(list.clone()).best(5.0).freedom.is_infinite());
        list.extend([(5.0, 500.0), (5.0, 900.0)]);
        let choice = Windows(list).best(5.0);
        assert!(
            choice.freedom.is_finite() && choice.trust(5.0, 900.0) < 0.1 && choice.trust(5.0, 5.0) > 0.8,
            "{choice:?}"
        );
    }
}
