//! What a multi-band model is told, and what it recorded.
//!
//! Memory of a record: a number for each measurement, six for each satellite. Panics where a measurement is asked for that
//! was not recorded.

use nalgebra::Vector3;
use surefix_core::filter::linearize::Rule;
use surefix_core::model::multi_band::{
    BANDS, Bands, ClockRows, Layout, MotionParameters, MultiBandModel, Satellite, Signal, Variances,
};

/// N(m, P) of the first epoch: means of zero, independent, by kind of state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// Variances of p^X, p^Y, p^Z `[m²]` and v^Z `[m²/s²]`.
    pub kinematic: [f64; 4],
    /// Variance of an ambiguity `[cycles²]`.
    pub ambiguity: f64,
    /// Variance of a bias `[m²]` and of its rate `[m²/s²]`.
    pub bias: f64,
}

impl Default for Prior {
    /// Appendix A, with the wide variance of ambiguities that was decided.
    fn default() -> Self {
        Self { kinematic: [1.0, 1.0, 1.0, 0.1], ambiguity: 100.0 * 100.0, bias: 0.01 }
    }
}

/// All but the measurements.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The base station relative to the linearisation point `[m]`; without one, differences are single.
    pub base: Option<Vector3<f64>>,
    /// The bands.
    pub bands: Bands,
    /// Noise of the measurements.
    pub variances: Variances,
    /// Which satellite clocks are measured.
    pub clock_rows: ClockRows,
    /// How states move.
    pub motion: MotionParameters,
    /// How ranges are linearised.
    pub rule: Rule,
    /// ε of the slip detector `[cycles]`.
    pub threshold: f64,
    /// The density before the first measurements.
    pub prior: Prior,
    /// Whether a pass with ambiguities among its states uses the measurements of epoch 0; the paper's Algorithm 1 does not.
    pub first_epoch: bool,
    /// Whether EM learns the noise of measurements too.
    pub learn_noise: bool,
}

impl Settings {
    /// The decided configuration: a wide prior of the ambiguities, σ_L = 0.05, σ_H = 10, ε = 0.5 cycles, all epochs used.
    pub fn recommended(bands: Bands, base: Option<Vector3<f64>>) -> Self {
        Self {
            base,
            bands,
            variances: Variances::default(),
            clock_rows: ClockRows::All,
            motion: MotionParameters::default(),
            rule: Rule::Taylor,
            threshold: 0.5,
            prior: Prior::default(),
            first_epoch: true,
            learn_noise: false,
        }
    }

    /// The model of an epoch with these satellites.
    pub fn model<'a>(&self, satellites: &'a [Satellite]) -> MultiBandModel<'a> {
        MultiBandModel {
            satellites,
            base: self.base,
            bands: self.bands,
            variances: self.variances,
            clock_rows: self.clock_rows,
        }
    }

    /// Where states are, for so many satellites.
    pub fn layout(&self, satellites: usize) -> Layout {
        Layout { satellites, clocks: self.base.is_none() }
    }
}

/// What was measured at an epoch. Differences i of band b and all signals are at b (N_s − 1) + i of their list.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Record {
    /// The satellites.
    pub satellites: Vec<Satellite>,
    /// Code, phase `[m]` and Doppler `[m/s]` of the bands themselves.
    pub signals: [Vec<f64>; Signal::ALL.len()],
    /// Virtual measurements `[m]`, in the model's order.
    pub virtual_rows: Vec<f64>,
}

impl Record {
    /// From the measurements y in the paper's order of rows; `None` unless there are as many as the model has rows.
    pub fn from_rows(settings: &Settings, satellites: Vec<Satellite>, y: &[f64]) -> Option<Self> {
        let model = settings.model(&satellites);
        let (m, signal_rows) = (model.layout().differences(), model.signal_rows());
        if y.len() != model.rows() {
            return None;
        }
        let mut signals = [(); Signal::ALL.len()].map(|()| vec![0.0; BANDS * m]);
        for (signal, raw) in signals.iter_mut().enumerate() {
            for i in 0..m {
                let combined = [0, 1, 2].map(|group| y[(group * Signal::ALL.len() + signal) * m + i]);
                for (band, value) in settings.bands.from_ionosphere_free(combined).into_iter().enumerate() {
                    raw[band * m + i] = value;
                }
            }
        }
        Some(Self { signals, virtual_rows: y[signal_rows..].to_vec(), satellites })
    }

    /// N_s − 1.
    pub fn differences(&self) -> usize {
        self.satellites.len().saturating_sub(1)
    }

    /// A signal of a band and difference.
    pub fn signal(&self, signal: Signal, band: usize, difference: usize) -> f64 {
        self.signals[signal as usize][band * self.differences() + difference]
    }

    /// A combination of a signal's bands, for a difference.
    pub fn combined(&self, signal: Signal, combination: &[f64; BANDS], difference: usize) -> f64 {
        dot_bands(combination, |band| self.signal(signal, band, difference))
    }
}

/// Σ_b c_b · value(b), without the bands that have no part in it.
pub(super) fn dot_bands(combination: &[f64; BANDS], value: impl Fn(usize) -> f64) -> f64 {
    let terms = combination.iter().enumerate().filter(|(_, c)| **c != 0.0);
    terms.map(|(band, c)| c * value(band)).sum()
}
