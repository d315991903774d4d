//! The noise of motion and measurements as parameters that EM may learn, and what they start with.
//!
//! Data of a span no longer than τ tell how fast coloured noise changes, σ²/τ, and not its level σ (H. Zhang, *Inconsistent
//! estimation and asymptotically equal interpolations in model-based geostatistics*, J. Am. Stat. Assoc. 99 (2004), on
//! estimation in a bounded domain). By its likelihood, a good receiver at rest has next to no multipath within minutes, and
//! its satellites are trusted as if their means were true. What stays the same for as long is a millimetre and more:
//! near-field multipath, and differences of the antennas' phase centres from direction to direction (with calibrations of
//! the type instead of the single antenna, coordinates differ by up to 4 mm horizontally and 10 mm vertically: Q. Baire et
//! al., GPS Solutions 18 (2014), as quoted in Sensors 21 (2021) 4639). So σ of phases is not learned below [`LEVEL`].

use super::tape::Tape;
use crate::smooth::model::Parameter;
use surefix_core::rtk::RtkConfig;

/// A type of measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Code pseudorange.
    Code,
    /// Carrier phase.
    Phase,
    /// Doppler as range rate.
    Doppler,
}

impl Kind {
    /// In the order in which they are taken.
    pub const ALL: [Self; 3] = [Self::Code, Self::Phase, Self::Doppler];

    /// For people.
    pub const fn name(self) -> &'static str {
        ["code", "phase", "doppler"][self as usize]
    }
}

/// Correlation times of coloured noise `[s]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeConstants {
    /// Of codes.
    pub code: f64,
    /// Of phases.
    pub phase: f64,
}

/// Parameters of each group.
const PER_GROUP: usize = 6;
/// Parameters before those of the groups.
const COMMON: usize = 5;

/// Least σ of the multipath of phases, single differences at the zenith `[m]`.
const LEVEL: f64 = 1e-3;

/// Parts of the configured variance with which noise starts. The configured one overbounds, see the engine's notes on
/// residuals of good receivers.
mod start {
    /// White and coloured noise of codes, then of phases.
    pub const CODE: [f64; 2] = [0.1, 0.3];
    pub const PHASE: [f64; 2] = [0.5, 0.2];
    /// Random walk of an ambiguity `[cycles/√s]`: none in truth, but for rounding.
    pub const STAY: f64 = 1e-5;
}

/// All parameters.
#[derive(Clone, Debug)]
pub struct Noise {
    parameters: Vec<Parameter>,
    /// Configured variances of single differences at the zenith, by type.
    zenith: [f64; 3],
    time_constants: TimeConstants,
    coloured: bool,
}

impl Noise {
    /// Index of the random walk of ambiguities.
    pub const STAY: usize = 2;

    /// What a configuration says.
    pub fn new(tape: &Tape, time_constants: TimeConstants, coloured: bool) -> Self {
        let config = tape.config();
        let zenith = zenith(config);
        let mut parameters = Vec::new();
        let mut add = |name: String, unit, variance: f64, bounds: [f64; 2], learned| {
            let bounds = bounds.map(|sigma| sigma * sigma);
            parameters.push(Parameter { name, unit, variance: variance.clamp(bounds[0], bounds[1]), bounds, learned });
        };
        let (unit, moves) = match config.motion.order() {
            1 => ("m/√s", false),
            2 => ("m/s^1.5", true),
            _ => ("m/s^2.5", true),
        };
        let q = if moves { config.motion_noise } else { 1e-12 };
        add("motion, horizontal".into(), unit, q, [1e-6, 1e3], moves);
        add("motion, vertical".into(), unit, q, [1e-6, 1e3], moves);
        add("ambiguities".into(), "cycles/√s", start::STAY * start::STAY, [1e-9, 1.0], false);
        let doppler = [1e-4, 1e2];
        add("Doppler, constant part".into(), "m/s", 0.5 * zenith[2], doppler, moves);
        add("Doppler, part with the elevation".into(), "m/s", 0.5 * zenith[2], doppler, moves);
        for group in tape.groups() {
            let signal = format!("{}{}", group.constellation.letter(), group.band);
            for (kind, [white, colour], least, bounds) in
                [(Kind::Phase, start::PHASE, LEVEL, [1e-4, 1.0]), (Kind::Code, start::CODE, 1e-2, [1e-2, 1e2])]
            {
                let (v, name) = (zenith[kind as usize], kind.name());
                add(format!("{name} {signal}, multipath"), "m", colour * v, [least, bounds[1]], coloured);
                add(format!("{name} {signal}, constant part"), "m", 0.5 * white * v, bounds, true);
                add(format!("{name} {signal}, part with the elevation"), "m", 0.5 * white * v, bounds, true);
            }
        }
        Self { parameters, zenith, time_constants, coloured }
    }

    /// All, by index.
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// Sets all variances.
    pub fn set(&mut self, variances: &[f64]) {
        self.parameters.iter_mut().zip(variances).for_each(|(parameter, &variance)| parameter.variance = variance);
    }

    /// Multiplies the standard deviations of motion, and those of measurements, that may be learned by a factor, within
    /// their bounds.
    pub fn scale(&mut self, [motion, measurements]: [f64; 2]) {
        for (i, parameter) in self.parameters.iter_mut().enumerate().filter(|(_, parameter)| parameter.learned) {
            let factor = if i < Self::STAY { motion } else { measurements };
            let [least, most] = parameter.bounds;
            parameter.variance = (parameter.variance * factor * factor).clamp(least, most);
        }
    }

    /// Whether there are states of coloured noise.
    pub fn is_coloured(&self) -> bool {
        self.coloured
    }

    /// The variance of a parameter.
    pub fn variance(&self, index: usize) -> f64 {
        self.parameters[index].variance
    }

    /// A type of measurement of a group, for people: "code G1".
    pub fn describe(kind: Kind, tape: &Tape, group: usize) -> String {
        match tape.groups().get(group) {
            Some(group) if kind != Kind::Doppler => {
                format!("{} {}{}", kind.name(), group.constellation.letter(), group.band)
            }
            _ => kind.name().into(),
        }
    }

    /// Index of the motion noise of an axis: east, north, up.
    pub fn motion(axis: usize) -> usize {
        usize::from(axis == 2)
    }

    /// Configured variance at the zenith.
    pub fn zenith(&self, kind: Kind) -> f64 {
        self.zenith[kind as usize]
    }

    /// Index and variance of the coloured noise of codes or phases of a group.
    pub fn coloured(&self, kind: Kind, group: usize) -> (usize, f64) {
        let index = COMMON + PER_GROUP * group + if kind == Kind::Phase { 0 } else { 3 };
        (index, self.variance(index))
    }

    /// Indices of α and β, the constant part of the white noise and that which goes with the elevation.
    pub fn white_components(&self, kind: Kind, group: usize) -> [usize; 2] {
        match kind {
            Kind::Doppler => [3, 4],
            Kind::Code | Kind::Phase => {
                let multipath = self.coloured(kind, group).0;
                [multipath + 1, multipath + 2]
            }
        }
    }

    /// α and β.
    pub fn white(&self, kind: Kind, group: usize) -> [f64; 2] {
        self.white_components(kind, group).map(|index| self.variance(index))
    }

    /// τ of coloured noise `[s]`.
    pub fn time_constant(&self, kind: Kind) -> f64 {
        if kind == Kind::Phase { self.time_constants.phase } else { self.time_constants.code }
    }
}

/// Variances of single differences at the zenith, without atmosphere: of two receivers, but for the Doppler.
fn zenith(config: &RtkConfig) -> [f64; 3] {
    let both = |noise: &surefix_core::model::noise::Noise| 2.0 * noise.variance(1.0, None);
    [both(&config.code), both(&config.phase), config.doppler * config.doppler]
}

#[cfg(test)]
mod tests {
    use super::super::tests::drive;
    use super::*;
    use surefix_core::gnss::solution::{Reason, Solution};
    use surefix_core::gnss::time::GpsTime;
    use surefix_core::model::motion::Motion;

    const TIMES: TimeConstants = TimeConstants { code: 20.0, phase: 600.0 };

    /// Single differences of two receivers: twice the variance of one; Dopplers are configured as differences.
    #[test]
    fn noise_starts_from_the_configured_variances() {
        let (tape, _) = drive(3.0);
        let noise = Noise::new(&tape, TIMES, true);
        let config = tape.config();
        assert!((noise.zenith(Kind::Code) - 2.0 * config.code.variance(1.0, None)).abs() < 1e-12);
        assert!((noise.zenith(Kind::Doppler) - config.doppler * config.doppler).abs() < 1e-12);
        assert_eq!(noise.variance(Noise::motion(0)), config.motion_noise);
        assert_eq!([Kind::Code, Kind::Phase].map(|kind| noise.time_constant(kind)), [20.0, 600.0]);
        let (code, phase) = (noise.coloured(Kind::Code, 0), noise.coloured(Kind::Phase, 0));
        assert!(code.0 != phase.0 && code.1 > phase.1 && phase.1 > 0.0);
    }

    #[test]
    fn what_cannot_show_is_not_learned() {
        let (moving, _) = drive(3.0);
        let learned = |noise: &Noise, part: &str| -> Vec<bool> {
            noise.parameters().iter().filter(|p| p.name.contains(part)).map(|p| p.learned).collect()
        };
        let noise = Noise::new(&moving, TIMES, true);
        assert_eq!(learned(&noise, "motion"), [true; 2]);
        assert_eq!(learned(&noise, "ambiguities"), [false]);
        assert!(learned(&noise, "multipath").iter().all(|&learned| learned));
        let noise = Noise::new(&moving, TIMES, false);
        assert!(!noise.is_coloured() && learned(&noise, "multipath").iter().all(|&learned| !learned));
        let mut resting = Tape::new(RtkConfig { motion: Motion::Static, ..RtkConfig::default() });
        resting.push(None, &Solution::none(GpsTime::from_week_tow(2114, 0.0), Reason::Complete));
        let noise = Noise::new(&resting, TIMES, true);
        assert_eq!(learned(&noise, "motion"), [false; 2]);
        assert_eq!(learned(&noise, "Doppler"), [false; 2]);
    }
}
