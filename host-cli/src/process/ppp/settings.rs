//! All settings of `surefix ppp`, as a TOML file has them.

use crate::smooth::ppp::noise::{Measurements, Process};
use crate::smooth::ppp::{Class, Options, Priors, Walk};
use serde::{Deserialize, Serialize};
use surefix_core::ppp::PppConfig;
use surefix_core::ppp::config::Motion;

/// Settings of the engine and of the smoother.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// The engine.
    pub engine: PppConfig,
    /// The smoother.
    pub smoothing: Smoothing,
}

/// How to smooth, and what EM learns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Smoothing {
    /// Whether the process noise of the motion is learned; that of a receiver at rest only if it has any.
    pub learn_motion: bool,
    /// Epochs to either side over which the noise of the velocity is learned; 0 for one value of the whole run.
    pub window: usize,
    /// Whether that of the zenith delay is learned.
    pub learn_zenith: bool,
    /// Whether the walk of ambiguities is learned: what orbits, clocks and reflections do to phases over minutes and hours.
    pub learn_ambiguities: bool,
    /// Whether errors that last are allowed for: their variances are enlarged, and process noise is learned once more.
    pub correlated: bool,
    /// Walk of ambiguities at the start `[m/√s]`.
    pub ambiguity_walk: f64,
    /// Degrees of freedom of the Student-t distribution of the default scheme.
    pub freedom: f64,
    /// Pools of less measurements are put together.
    pub minimum: usize,
    /// Least standard deviations of codes and phases that are learned `[m]`.
    pub floors: [f64; 2],
    /// Most iterations of EM.
    pub iterations: usize,
    /// Most evaluations of accelerated EM after them.
    pub accelerated: usize,
    /// Standard deviations of codes and phases with which EM starts, whatever the elevation `[m]`; those of the engine if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<[f64; 2]>,
    /// Factor on the variances of process noise with which EM starts.
    pub process_factor: f64,
}

impl Default for Smoothing {
    fn default() -> Self {
        Self {
            learn_motion: true,
            window: 10,
            learn_zenith: true,
            learn_ambiguities: false,
            correlated: true,
            ambiguity_walk: 0.0,
            freedom: 5.0,
            minimum: 30,
            floors: [0.1, 1e-3],
            iterations: 10,
            accelerated: 20,
            start: None,
            process_factor: 1.0,
        }
    }
}

impl Settings {
    /// What the smoother is told, with EM by a scheme or without EM.
    pub fn options(&self, measurements: Option<Measurements>) -> Options {
        let (engine, smoothing) = (&self.engine, &self.smoothing);
        let mut options = match engine.motion {
            Motion::Static => Options::at_rest(),
            Motion::Kinematic => Options::moving(),
        };
        options.gradients = engine.gradients;
        let (process, prior) = (engine.process, engine.prior);
        let pooled = |learn: bool| if learn { Process::Pooled } else { Process::Fixed };
        let motion = match engine.motion {
            // A receiver at rest does not move: there is nothing to learn, unless someone says that it does.
            Motion::Static => (process.position, pooled(smoothing.learn_motion && process.position > 0.0)),
            Motion::Kinematic if !smoothing.learn_motion => (process.acceleration, Process::Fixed),
            Motion::Kinematic if smoothing.window == 0 => (process.acceleration, Process::Pooled),
            Motion::Kinematic => (process.acceleration, Process::Window(smoothing.window)),
        };
        let ambiguity = process.ambiguity.max(smoothing.ambiguity_walk * smoothing.ambiguity_walk);
        let learns = measurements.is_some();
        for (class, (variance, learned)) in [
            (Class::Motion, motion),
            (Class::Zenith, (process.zenith, pooled(smoothing.learn_zenith))),
            (Class::Gradients, (process.gradients, Process::Fixed)),
            (Class::Biases, (process.inter_system, Process::Fixed)),
            (Class::Ionosphere, (process.ionosphere, Process::Fixed)),
            (Class::Ambiguities, (ambiguity, pooled(smoothing.learn_ambiguities))),
        ] {
            let factor = if learned == Process::Fixed { 1.0 } else { smoothing.process_factor };
            let learned = if learns { learned } else { Process::Fixed };
            options.walks[class as usize] = Walk { sigma: (variance * factor).sqrt(), learned };
        }
        options.priors = Priors {
            position: prior.position,
            velocity: prior.velocity,
            clock: prior.clock,
            bias: prior.inter_system,
            zenith: prior.zenith,
            gradient: prior.gradients,
            ionosphere: prior.ionosphere,
            ambiguity: prior.ambiguity,
        };
        (options.minimum, options.floors, options.start) = (smoothing.minimum, smoothing.floors, smoothing.start);
        options.learning.accelerated = smoothing.accelerated;
        options.correlated = smoothing.correlated && learns;
        if options.walk(Class::Motion).learned == Process::Fixed {
            options.learning.scan.clear();
        }
        options.learning.iterations = if learns { smoothing.iterations } else { 0 };
        options.measurements = match measurements {
            Some(Measurements::StudentT(_)) => Measurements::StudentT(smoothing.freedom),
            Some(Measurements::Epoch) => return options.by_epoch(),
            Some(other) => other,
            None => Measurements::Fixed,
        };
        options
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_come_back_from_their_file_and_unknown_ones_are_refused() {
        let settings = Settings::default();
        let text = toml::to_string(&settings).unwrap();
        assert_eq!(toml::from_str::<Settings>(&text).unwrap(), settings);
        assert!(toml::from_str::<Settings>("[smoothing]\nwindows = 3").is_err());
    }

    #[test]
    fn without_em_nothing_is_learned_and_a_receiver_at_rest_stays_there() {
        let settings = Settings::default();
        let plain = settings.options(None);
        assert!(plain.walks.iter().all(|walk| walk.learned == Process::Fixed));
        assert_eq!((plain.measurements, plain.learning.iterations), (Measurements::Fixed, 0));
        let learning = settings.options(Some(Measurements::StudentT(3.0)));
        assert_eq!(learning.walk(Class::Motion), Walk { sigma: 0.0, learned: Process::Fixed });
        assert_eq!(learning.walk(Class::Zenith).learned, Process::Pooled);
        assert_eq!(learning.measurements, Measurements::StudentT(5.0));
    }
}
