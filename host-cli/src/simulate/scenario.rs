//! What to simulate: a TOML file, of which every part has a default.
//!
//! The defaults are [`Scenario::default`], as `surefix simulate --print-default` shows them. A file needs only what
//! differs; a key that the default does not have is an error that names it.

use nalgebra::Vector3;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use surefix_core::gnss::geodesy::Geodetic;
use surefix_core::gnss::satellite::Constellation;
use surefix_core::gnss::signal::Signal;
use surefix_core::gnss::time::GpsTime;
use toml::{Table, Value};

/// A whole scenario. Times are GPST, `start_s` of intervals counts from the scenario's start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Seed of everything that is random: the same seed gives the same files.
    pub seed: u64,
    /// GPS week of the start.
    pub week: i32,
    /// Seconds of week of the start `[s]`.
    pub tow_s: f64,
    /// Length `[s]`.
    pub duration_s: f64,
    /// Satellites below are not tracked `[deg]`.
    pub elevation_mask_deg: f64,
    /// What is in the sky.
    pub satellites: Satellites,
    /// Delay by the ionosphere.
    pub ionosphere: Ionosphere,
    /// Delay by the troposphere.
    pub troposphere: Troposphere,
    /// Where the base is, and its receiver.
    pub base: Base,
    /// Where the rover goes, and its receiver.
    pub rover: Rover,
}

/// Constellations, their signals and what their broadcasts are worth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Satellites {
    /// GPS signals as RINEX names them (bands 1, 2, 5); empty for no GPS.
    pub gps: Vec<String>,
    /// Galileo signals (bands 1, 5, 7); empty for no Galileo.
    pub galileo: Vec<String>,
    /// Standard deviation of each coordinate of the broadcast orbits `[m]`.
    pub orbit_sigma_m: f64,
    /// Standard deviation of the broadcast clocks `[m]`.
    pub clock_sigma_m: f64,
}

/// Klobuchar's model with typical coefficients, which are broadcast, times a factor, which is not.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ionosphere {
    /// True delay over broadcast delay; 0 for no ionosphere.
    pub scale: f64,
    /// Additional vertical delay on L1 per kilometre east and north of the base `[mm/km]`.
    pub gradient_mm_km: [f64; 2],
}

/// Saastamoinen's model in the standard atmosphere with Niell's mapping.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Troposphere {
    /// True delay over modelled delay; 0 for no troposphere.
    pub scale: f64,
    /// Relative humidity, 0…1.
    pub humidity: f64,
    /// Additional zenith wet delay at the rover only `[m]`.
    pub rover_wet_bias_m: f64,
}

/// The base.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Base {
    /// Latitude `[deg]`.
    pub latitude_deg: f64,
    /// Longitude `[deg]`.
    pub longitude_deg: f64,
    /// Ellipsoidal height `[m]`.
    pub height_m: f64,
    /// How much later than its time a base epoch arrives in the device log `[s]`.
    pub latency_s: f64,
    /// Its receiver.
    pub receiver: Receiver,
}

/// The rover.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rover {
    /// East, north, up of the base at the start `[m]`.
    pub start_enu_m: [f64; 3],
    /// How it moves.
    pub motion: Motion,
    /// Its receiver.
    pub receiver: Receiver,
}

/// The kind of motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MotionKind {
    /// At rest.
    Static,
    /// On a level circle: needs radius and speed.
    Circle,
    /// Along manoeuvres, which repeat.
    Drive,
}

/// How the rover moves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Motion {
    /// Static, circle or drive.
    pub kind: MotionKind,
    /// Radius of the circle `[m]`.
    pub radius_m: f64,
    /// Speed on the circle, and greatest speed of a drive `[m/s]`.
    pub speed_m_s: f64,
    /// A drive goes over hills of this height `[m]`…
    pub hill_height_m: f64,
    /// …one every so many metres travelled.
    pub hill_length_m: f64,
    /// What the driver does, from rest, heading north.
    pub manoeuvres: Vec<Manoeuvre>,
}

/// A part of a drive with constant acceleration and rate of turn. The speed stays between 0 and the greatest speed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manoeuvre {
    /// How long `[s]`.
    pub seconds: f64,
    /// Along the path `[m/s²]`.
    #[serde(default)]
    pub acceleration: f64,
    /// Rate of turn, clockwise `[deg/s]`.
    #[serde(default)]
    pub turn: f64,
}

/// A receiver with its antenna and surroundings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Receiver {
    /// Between epochs `[s]`.
    pub interval_s: f64,
    /// Its clock.
    pub clock: Clock,
    /// Delay of Galileo against GPS in the receiver, code and phase `[m]`.
    pub inter_system_bias_m: f64,
    /// White noise.
    pub noise: Noise,
    /// Errors correlated in time.
    pub multipath: Multipath,
    /// Cycle slips.
    pub slips: Slips,
    /// When satellites are blocked. A base epoch without satellites is a gap.
    pub outages: Vec<Outage>,
}

/// A receiver clock: offset + drift · t + wander · sin(2π t / period), seconds ahead of GPST.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Clock {
    /// At the start `[s]`.
    pub offset_s: f64,
    /// Rate `[s/s]`.
    pub drift: f64,
    /// Amplitude of the wander `[s]`.
    pub wander_s: f64,
    /// Period of the wander `[s]`.
    pub wander_period_s: f64,
    /// Whether the receiver keeps its clock within half a millisecond by jumps of one millisecond.
    pub millisecond_jumps: bool,
}

/// White noise. Deviations are those at the zenith; they grow as the signal weakens, σ ∝ 10^(−Δ(C/N0)/20).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Noise {
    /// Code `[m]`.
    pub code_m: f64,
    /// Phase `[m]`.
    pub phase_m: f64,
    /// Doppler, as range rate `[m/s]`.
    pub doppler_m_s: f64,
    /// C/N0 at the zenith `[dB-Hz]`.
    pub cn0_zenith: f64,
    /// C/N0 at the horizon is so much lower `[dB]`; in between it goes with the sine of the elevation.
    pub cn0_drop: f64,
    /// Noise of C/N0 `[dB]`.
    pub cn0_sigma: f64,
}

/// First-order Gauss–Markov errors of each signal of each satellite, growing with weakness as the noise does.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Multipath {
    /// Standard deviation of code at the zenith `[m]`.
    pub code_m: f64,
    /// Standard deviation of phase at the zenith `[m]`.
    pub phase_m: f64,
    /// Correlation time `[s]`.
    pub time_s: f64,
}

/// Cycle slips of each signal of each satellite, independent of each other.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Slips {
    /// How many an hour, for one signal.
    pub per_hour: f64,
    /// Greatest size; sizes 1…largest and both signs are equally likely `[cycles]`.
    pub largest: u32,
    /// Fraction that the receiver does not flag.
    pub unflagged: f64,
    /// Fraction that are half a cycle, flagged as such until the receiver resolves it.
    pub half_cycle: f64,
    /// After that time `[s]`.
    pub half_cycle_s: f64,
}

/// When satellites are blocked.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outage {
    /// From, after the start `[s]`.
    pub start_s: f64,
    /// For `[s]`.
    pub duration_s: f64,
    /// Only satellites below are blocked `[deg]`; all, if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub below_deg: Option<f64>,
}

impl Outage {
    /// Whether a satellite at `elevation` `[rad]` is blocked `seconds` after the start.
    pub fn blocks(&self, seconds: f64, elevation: f64) -> bool {
        let during = seconds >= self.start_s && seconds < self.start_s + self.duration_s;
        during && self.below_deg.is_none_or(|below| elevation.to_degrees() < below)
    }
}

/// Why a scenario cannot be simulated.
#[derive(Debug, thiserror::Error)]
pub enum ScenarioError {
    /// Not TOML.
    #[error("{file}: {problem}")]
    Syntax {
        /// The file.
        file: String,
        /// What the parser says, with line and column.
        problem: String,
    },
    /// A key that does not exist.
    #[error("{file}: there is no `{key}`; see `surefix {command} --print-default` for what there is")]
    UnknownKey {
        /// The file.
        file: String,
        /// The key with the tables that it is in.
        key: String,
        /// The subcommand whose scenario it is.
        command: &'static str,
    },
    /// A value in a file makes no sense. The message contains its cause, which is therefore no `source`.
    #[error("{file}: {cause}")]
    InFile {
        /// The file.
        file: String,
        /// Which value, and what it must be.
        cause: Box<ScenarioError>,
    },
    /// A value that makes no sense.
    #[error("scenario: {key} is {value}, but must be {must}")]
    Value {
        /// The key.
        key: &'static str,
        /// Its value.
        value: String,
        /// What it must be.
        must: &'static str,
    },
}

impl Scenario {
    /// Reads a scenario from TOML that messages call `file`; what it leaves out is the default.
    pub fn from_toml(file: &str, text: &str) -> Result<Self, ScenarioError> {
        over_defaults("simulate", file, text, Self::validate)
    }

    /// The scenario as TOML.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).unwrap_or_default()
    }

    /// Start of the scenario.
    pub fn start(&self) -> GpsTime {
        GpsTime::from_week_tow(self.week, self.tow_s)
    }

    /// The base, ECEF `[m]`, on the grid of 0.1 mm that the headers of observation files have.
    pub fn base_position(&self) -> Vector3<f64> {
        let (latitude, longitude) = (self.base.latitude_deg.to_radians(), self.base.longitude_deg.to_radians());
        let position = Geodetic { latitude, longitude, height: self.base.height_m }.to_ecef();
        position.map(|coordinate| (coordinate * 1e4).round() / 1e4)
    }

    /// The signals of a constellation; an error names one that it does not send.
    pub fn signals(&self, constellation: Constellation) -> Result<Vec<Signal>, ScenarioError> {
        let (key, names, bands) = match constellation {
            Constellation::Gps => ("satellites.gps", &self.satellites.gps, b"125"),
            Constellation::Galileo => ("satellites.galileo", &self.satellites.galileo, b"157"),
            _ => return Ok(Vec::new()),
        };
        let signal = |name: &String| {
            let known = name.parse().ok().filter(|signal: &Signal| bands.contains(&signal.band()));
            known.ok_or_else(|| ScenarioError::Value {
                key,
                value: format!("{name:?}"),
                must: "signals such as \"1C\", of bands 1, 2, 5 for GPS and 1, 5, 7 for Galileo",
            })
        };
        names.iter().map(signal).collect()
    }

    /// Whether all values make sense.
    pub fn validate(&self) -> Result<(), ScenarioError> {
        within("week", self.week.into(), 1.0, 9999.0, "1…9999")?;
        within("tow_s", self.tow_s, 0.0, 604_799.0, "0…604799 s")?;
        within("duration_s", self.duration_s, 0.0, 86_400.0, "at most a day")?;
        within("elevation_mask_deg", self.elevation_mask_deg, 0.0, 89.0, "0…89°")?;
        within("base.latitude_deg", self.base.latitude_deg, -90.0, 90.0, "−90…90°")?;
        within("base.longitude_deg", self.base.longitude_deg, -360.0, 360.0, "−360…360°")?;
        within("base.height_m", self.base.height_m, -1e3, 1e4, "−1…10 km")?;
        within("troposphere.humidity", self.troposphere.humidity, 0.0, 1.0, "0…1")?;
        within("rover.motion.speed_m_s", self.rover.motion.speed_m_s, 0.0, 1e3, "0…1000 m/s")?;
        if self.rover.motion.kind == MotionKind::Circle {
            within("rover.motion.radius_m", self.rover.motion.radius_m, 1e-3, 1e6, "1 mm…1000 km")?;
        }
        within("rover.motion.hill_length_m", self.rover.motion.hill_length_m, 1.0, 1e7, "at least 1 m")?;
        for manoeuvre in &self.rover.motion.manoeuvres {
            within("seconds of a manoeuvre", manoeuvre.seconds, 1e-2, 1e6, "at least 0.01 s")?;
        }
        for receiver in [&self.base.receiver, &self.rover.receiver] {
            within("receiver.interval_s", receiver.interval_s, 0.01, 3600.0, "0.01…3600 s")?;
            within("clock.offset_s", receiver.clock.offset_s, -0.05, 0.05, "−0.05…0.05 s")?;
            within("clock.drift", receiver.clock.drift, -1e-4, 1e-4, "−1e-4…1e-4")?;
            within("clock.wander_period_s", receiver.clock.wander_period_s, 1.0, 1e9, "at least 1 s")?;
            within("multipath.time_s", receiver.multipath.time_s, 1e-3, 1e9, "at least 0.001 s")?;
            within("slips.largest", receiver.slips.largest.into(), 1.0, 1e6, "1…1000000 cycles")?;
            within("slips.unflagged", receiver.slips.unflagged, 0.0, 1.0, "0…1")?;
            within("slips.half_cycle", receiver.slips.half_cycle, 0.0, 1.0, "0…1")?;
        }
        self.signals(Constellation::Gps)?;
        self.signals(Constellation::Galileo)?;
        Ok(())
    }
}

/// Refuses a value outside `low` to `high`, NaN too.
pub(crate) fn within(
    key: &'static str,
    value: f64,
    low: f64,
    high: f64,
    must: &'static str,
) -> Result<(), ScenarioError> {
    let fits = (low..=high).contains(&value);
    if fits { Ok(()) } else { Err(ScenarioError::Value { key, value: value.to_string(), must }) }
}

/// Reads the scenario of a subcommand from TOML that messages call `file`; what it leaves out is the default. Its values
/// must pass `validate`.
pub(crate) fn over_defaults<T: Default + Serialize + DeserializeOwned>(
    command: &'static str,
    file: &str,
    text: &str,
    validate: impl Fn(&T) -> Result<(), ScenarioError>,
) -> Result<T, ScenarioError> {
    let syntax = |problem: String| ScenarioError::Syntax { file: file.to_owned(), problem };
    let given: Table = text.parse().map_err(|error: toml::de::Error| syntax(error.to_string()))?;
    let mut merged = Table::try_from(T::default()).map_err(|error| syntax(error.to_string()))?;
    merge(&mut merged, given).map_err(|key| ScenarioError::UnknownKey { file: file.to_owned(), key, command })?;
    let scenario: T = merged.try_into().map_err(|error: toml::de::Error| syntax(error.to_string()))?;
    validate(&scenario).map_err(|cause| ScenarioError::InFile { file: file.to_owned(), cause: Box::new(cause) })?;
    Ok(scenario)
}

/// Puts what is given over the defaults; an error is the key that these do not have.
pub(crate) fn merge(defaults: &mut Table, given: Table) -> Result<(), String> {
    for (key, value) in given {
        match (defaults.get_mut(&key), value) {
            (None, _) => return Err(key),
            (Some(Value::Table(defaults)), Value::Table(given)) => {
                merge(defaults, given).map_err(|inner| format!("{key}.{inner}"))?;
            }
            (Some(default), value) => *default = value,
        }
    }
    Ok(())
}

impl Default for Scenario {
    /// Ten minutes of driving near a base in Bavaria, two bands, with slips, a tunnel and a street between houses.
    fn default() -> Self {
        Self {
            seed: 1,
            week: 2400,
            tow_s: 302_400.0,
            duration_s: 600.0,
            elevation_mask_deg: 10.0,
            satellites: Satellites {
                gps: vec!["1C".into(), "5Q".into()],
                galileo: vec!["1C".into(), "5Q".into()],
                orbit_sigma_m: 0.5,
                clock_sigma_m: 0.5,
            },
            ionosphere: Ionosphere { scale: 1.3, gradient_mm_km: [1.0, 1.0] },
            troposphere: Troposphere { scale: 1.0, humidity: 0.5, rover_wet_bias_m: 0.0 },
            base: Base {
                latitude_deg: 49.144_2,
                longitude_deg: 12.878_9,
                height_m: 666.0,
                latency_s: 0.3,
                receiver: Receiver {
                    clock: Clock { offset_s: -2e-5, drift: 2e-9, ..Receiver::rover().clock },
                    inter_system_bias_m: -1.5,
                    noise: Noise { code_m: 0.2, phase_m: 0.001, ..Receiver::rover().noise },
                    multipath: Multipath { code_m: 0.2, phase_m: 0.001, time_s: 100.0 },
                    slips: Slips { per_hour: 0.0, ..Receiver::rover().slips },
                    outages: vec![Outage { start_s: 500.0, duration_s: 6.0, below_deg: None }],
                    ..Receiver::rover()
                },
            },
            rover: Rover { start_enu_m: [850.0, -420.0, -15.0], motion: Motion::city(), receiver: Receiver::rover() },
        }
    }
}

impl Receiver {
    fn rover() -> Self {
        Self {
            interval_s: 1.0,
            clock: Clock {
                offset_s: 1e-4,
                drift: 1e-7,
                wander_s: 1e-8,
                wander_period_s: 400.0,
                millisecond_jumps: false,
            },
            inter_system_bias_m: 2.0,
            noise: Noise {
                code_m: 0.3,
                phase_m: 0.0015,
                doppler_m_s: 0.03,
                cn0_zenith: 50.0,
                cn0_drop: 14.0,
                cn0_sigma: 0.5,
            },
            multipath: Multipath { code_m: 0.3, phase_m: 0.002, time_s: 30.0 },
            slips: Slips { per_hour: 6.0, largest: 20, unflagged: 0.3, half_cycle: 0.1, half_cycle_s: 8.0 },
            outages: vec![
                Outage { start_s: 240.0, duration_s: 8.0, below_deg: None },
                Outage { start_s: 390.0, duration_s: 40.0, below_deg: Some(35.0) },
            ],
        }
    }
}

impl Motion {
    /// Town streets: up to 20 m/s, crossings, traffic lights, hills.
    fn city() -> Self {
        let manoeuvre = |seconds, acceleration, turn| Manoeuvre { seconds, acceleration, turn };
        Self {
            kind: MotionKind::Drive,
            radius_m: 50.0,
            speed_m_s: 20.0,
            hill_height_m: 12.0,
            hill_length_m: 1500.0,
            manoeuvres: vec![
                manoeuvre(20.0, 0.0, 0.0),
                manoeuvre(8.0, 1.5, 0.0),
                manoeuvre(18.0, 0.0, 0.0),
                manoeuvre(5.0, -1.0, 0.0),
                manoeuvre(7.5, 0.0, 12.0),
                manoeuvre(10.0, 1.3, 0.0),
                manoeuvre(25.0, 0.0, 1.0),
                manoeuvre(10.0, -2.0, 0.0),
                manoeuvre(15.0, 0.0, 0.0),
                manoeuvre(6.0, 1.2, 0.0),
                manoeuvre(8.0, 0.0, -11.0),
                manoeuvre(4.0, 1.5, 0.0),
                manoeuvre(20.0, 0.0, 0.0),
                manoeuvre(4.0, -1.5, 0.0),
                manoeuvre(8.0, 0.0, 11.0),
                manoeuvre(6.0, -1.2, 0.0),
            ],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_valid_and_comes_back() {
        let default = Scenario::default();
        assert_eq!(Scenario::from_toml("d", &default.to_toml()).unwrap(), default);
        assert_eq!(Scenario::from_toml("d", "").unwrap(), default);
    }

    #[test]
    fn a_file_needs_only_what_differs() {
        let text = "seed = 7\n[rover.motion]\nkind = \"static\"\n[base.receiver.slips]\nper_hour = 1\n";
        let scenario = Scenario::from_toml("s", text).unwrap();
        assert_eq!((scenario.seed, scenario.rover.motion.kind), (7, MotionKind::Static));
        assert_eq!(scenario.base.receiver.slips, Slips { per_hour: 1.0, ..Receiver::rover().slips });
        assert_eq!(scenario.base.receiver.noise, Scenario::default().base.receiver.noise);
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, expected) in [
            ("seeed = 1", "s.toml: there is no `seeed`"),
            ("[rover.reciever]\ninterval_s = 1", "there is no `rover.reciever`"),
            ("seed =", "line 1"),
            ("duration_s = 1e9", "duration_s is 1000000000"),
            ("duration_s = nan", "duration_s is NaN"),
            ("[satellites]\ngps = [\"7Q\"]", "satellites.gps is \"7Q\""),
            ("[rover.receiver]\noutages = [{ start_s = 1, lasts = 2 }]", "lasts"),
        ] {
            let error = Scenario::from_toml("s.toml", text).unwrap_err().to_string();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }

    #[test]
    fn an_outage_has_a_beginning_and_an_end_and_may_spare_the_zenith() {
        let outage = Outage { start_s: 10.0, duration_s: 5.0, below_deg: Some(30.0) };
        let blocked = |seconds, degrees: f64| outage.blocks(seconds, degrees.to_radians());
        assert_eq!(
            [blocked(9.9, 20.0), blocked(10.0, 20.0), blocked(15.0, 20.0), blocked(12.0, 31.0)],
            [false, true, false, false]
        );
    }
}
