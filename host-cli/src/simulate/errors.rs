//! What a receiver adds to a perfect signal: noise and multipath, both stronger on weaker signals.

use super::scenario::{Multipath, Noise};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use surefix_core::gnss::time::GpsTime;

/// Errors of the observables of a signal at an epoch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Of code `[m]`.
    pub code: f64,
    /// Of phase `[m]`.
    pub phase: f64,
    /// Of the range rate that Doppler stands for `[m/s]`.
    pub rate: f64,
    /// C/N0 with its noise `[dB-Hz]`.
    pub cn0: f64,
}

/// A pair of independent first-order Gauss–Markov processes of unit variance.
#[derive(Clone, Debug, Default)]
pub(crate) struct GaussMarkov {
    last: Option<GpsTime>,
    states: [f64; 2],
}

impl GaussMarkov {
    /// The states at the next epoch, correlated with the ones before over `time_s` `[s]`.
    pub fn next(&mut self, time: GpsTime, time_s: f64, rng: &mut ChaCha8Rng) -> [f64; 2] {
        // x_k = φ x_{k−1} + √(1 − φ²) w with φ = exp(−Δt/τ): unit variance at all times.
        let memory = self.last.map_or(0.0, |last| (-time.since(last) / time_s).exp());
        self.last = Some(time);
        for state in &mut self.states {
            *state = memory * *state + (1.0 - memory * memory).sqrt() * rng.sample::<f64, _>(StandardNormal);
        }
        self.states
    }
}

/// The errors of one signal of one satellite at one receiver, over time.
#[derive(Clone, Debug)]
pub struct Errors {
    rng: ChaCha8Rng,
    /// Multipath of code and phase in units of its standard deviation.
    multipath: GaussMarkov,
}

impl Errors {
    /// Errors drawn from `rng`.
    pub fn new(rng: ChaCha8Rng) -> Self {
        Self { rng, multipath: GaussMarkov::default() }
    }

    /// The errors at the next epoch.
    pub fn next(&mut self, time: GpsTime, elevation: f64, noise: &Noise, multipath: &Multipath) -> Sample {
        let [code, phase] = self.multipath.next(time, multipath.time_s, &mut self.rng);
        let mut normal = || self.rng.sample::<f64, _>(StandardNormal);
        let drop = noise.cn0_drop * (1.0 - elevation.sin());
        let weakness = 10_f64.powf(drop / 20.0);
        Sample {
            code: weakness * (noise.code_m * normal() + multipath.code_m * code),
            phase: weakness * (noise.phase_m * normal() + multipath.phase_m * phase),
            rate: weakness * noise.doppler_m_s * normal(),
            cn0: noise.cn0_zenith - drop + noise.cn0_sigma * normal(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::scenario::Scenario;
    use super::*;
    use rand::SeedableRng;

    /// Mean square and autocorrelation at a lag.
    fn moments(values: &[f64], lag: usize) -> (f64, f64) {
        let square = values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64;
        let product = values.iter().zip(&values[lag..]).map(|(a, b)| a * b).sum::<f64>() / (values.len() - lag) as f64;
        (square, product / square)
    }

    fn drawn(noise: &Noise, multipath: &Multipath, elevation: f64) -> Vec<Sample> {
        let mut errors = Errors::new(ChaCha8Rng::seed_from_u64(5));
        let at = |k: i32| GpsTime::from_week_tow(2400, f64::from(k));
        (0..40_000).map(|k| errors.next(at(k), elevation, noise, multipath)).collect()
    }

    // 40 000 samples: white mean squares are known to 0.7 % (1σ); with τ = 10 s about 4000 are independent, 2.2 %.
    #[test]
    fn noise_has_the_configured_size() {
        let noise = Scenario::default().rover.receiver.noise;
        let still = Multipath { code_m: 0.0, phase_m: 0.0, time_s: 10.0 };
        let samples = drawn(&noise, &still, std::f64::consts::FRAC_PI_2);
        for (values, sigma) in [
            (samples.iter().map(|s| s.code).collect::<Vec<_>>(), noise.code_m),
            (samples.iter().map(|s| s.phase).collect(), noise.phase_m),
            (samples.iter().map(|s| s.rate).collect(), noise.doppler_m_s),
            (samples.iter().map(|s| s.cn0 - noise.cn0_zenith).collect(), noise.cn0_sigma),
        ] {
            let (square, correlation) = moments(&values, 1);
            assert!((square / sigma.powi(2) - 1.0).abs() < 0.03 && correlation.abs() < 0.02);
        }
    }

    #[test]
    fn multipath_has_the_configured_size_and_memory() {
        let silent = Noise { code_m: 0.0, phase_m: 0.0, cn0_drop: 20.0, ..Scenario::default().rover.receiver.noise };
        let multipath = Multipath { code_m: 0.5, phase_m: 0.01, time_s: 10.0 };
        // At 30° with a drop of 20 dB from zenith to horizon the signal is 10 dB weaker: σ grows by √10.
        let samples = drawn(&silent, &multipath, 30_f64.to_radians());
        for (values, sigma) in [
            (samples.iter().map(|s| s.code).collect::<Vec<_>>(), multipath.code_m),
            (samples.iter().map(|s| s.phase).collect(), multipath.phase_m),
        ] {
            let (square, correlation) = moments(&values, 10);
            assert!((square / (10.0 * sigma.powi(2)) - 1.0).abs() < 0.1, "{square}");
            assert!((correlation - (-1.0_f64).exp()).abs() < 0.08, "{correlation}");
        }
    }
}
