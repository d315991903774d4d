//! What a city does to observations: a TOML file, of which every part has a default.
//!
//! The default is a city of moderate height, as `surefix degrade --print-default` shows it. Its numbers:
//!
//! | what | value | why |
//! |---|---|---|
//! | stretches between buildings | 60…120 s in every 300 s | 0.5…1 km at town speed; what lies between lets a receiver recover |
//! | masks | 35…60° across the street | five floors (18 m) on either side of a street of 20 to 50 m |
//! | one building | 5…20 s, every seventh missing | blocks of 50 to 200 m at 10 m/s, crossings between them |
//! | reflected field | 0.4 of the direct one at the horizon | 8 dB weaker than the direct signal, as a wall of glass or concrete leaves it |
//! | its delay | 5…20 m | twice the distance of a wall 2.5 to 10 m away; makes code errors of 1 to 4 m (rms) |
//! | correlation | 30 s | slow traffic; the time for which the findings on adaptive noise were made |
//! | satellites seen by reflection only | 30 % of those blocked, +5…+60 m | at most twice the distance of a wall 2.5 to 30 m away |
//! | slips | 10 an hour and signal, 1…5 cycles | a tracking loop slips every few minutes at weak signals: some in each stretch |
//!
//! [`Scenario::dense`] is a harder one.

use crate::simulate::scenario::{ScenarioError, over_defaults, within};
use serde::{Deserialize, Serialize};

/// A whole scenario. Times count from the first epoch of the rover.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Seed of everything that is random: the same seed gives the same files.
    pub seed: u64,
    /// Streets between buildings.
    pub canyons: Canyons,
    /// Reflections that come with the direct signal, between buildings.
    pub reflections: Reflections,
    /// Satellites of which only a reflection is seen.
    pub nlos: Nlos,
    /// Jumps of ambiguities.
    pub slips: Slips,
}

/// Stretches of time between buildings. Pairs are least and greatest of a uniform distribution.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Canyons {
    /// When the first begins `[s]`.
    pub start_s: f64,
    /// From the beginning of one to that of the next `[s]`.
    pub period_s: f64,
    /// How long one lasts `[s]`.
    pub duration_s: [f64; 2],
    /// How long one passes a building, on either side `[s]`.
    pub building_s: [f64; 2],
    /// Elevation of a roof across the street `[deg]`; along the street nothing is hidden.
    pub mask_deg: [f64; 2],
    /// Probability that a building is missing.
    pub gap: f64,
    /// Whether the street leads where the rover goes…
    pub follow_heading: bool,
    /// …or always there: azimuth `[deg]`.
    pub street_deg: f64,
}

/// A field z, relative to the direct one, that is reflected by walls: it adds delay · Re z to the code, λ/2π · arg(1 + z)
/// to the phase and 20 lg |1 + z| to C/N0.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reflections {
    /// Rms of |z| at the horizon; it falls with the cosine of the elevation. |z| itself stays below 0.95.
    pub amplitude: f64,
    /// Factor on it, drawn for each stretch.
    pub severity: [f64; 2],
    /// Excess path, drawn for each stretch `[m]`.
    pub delay_m: [f64; 2],
    /// Correlation time of z `[s]`.
    pub time_s: f64,
    /// Loss of C/N0 between buildings `[dB]`.
    pub cn0_drop_db: f64,
}

/// Satellites behind a building.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Nlos {
    /// Probability that one is seen by reflection; it is gone else.
    pub probability: f64,
    /// Excess path, drawn each time `[m]`…
    pub excess_m: [f64; 2],
    /// …and its variation: standard deviation `[m]`…
    pub excess_sigma_m: f64,
    /// …and correlation time `[s]`.
    pub excess_time_s: f64,
    /// Loss of C/N0, drawn each time `[dB]`.
    pub cn0_drop_db: [f64; 2],
    /// Probability that the phase of the reflection is tracked; there is none else.
    pub phase: f64,
}

/// Jumps of ambiguities.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Slips {
    /// Probability that a new ambiguity after a loss of the signal is flagged.
    pub reacquired_flagged: f64,
    /// Slips between buildings, which are never flagged: how many an hour, for one signal.
    pub per_hour: f64,
    /// Their greatest size; sizes 1…largest and both signs are equally likely `[cycles]`.
    pub largest: u32,
}

impl Default for Scenario {
    fn default() -> Self {
        Self {
            seed: 1,
            canyons: Canyons {
                start_s: 120.0,
                period_s: 300.0,
                duration_s: [60.0, 120.0],
                building_s: [5.0, 20.0],
                mask_deg: [35.0, 60.0],
                gap: 0.15,
                follow_heading: true,
                street_deg: 0.0,
            },
            reflections: Reflections {
                amplitude: 0.4,
                severity: [0.5, 1.5],
                delay_m: [5.0, 20.0],
                time_s: 30.0,
                cn0_drop_db: 3.0,
            },
            nlos: Nlos {
                probability: 0.3,
                excess_m: [5.0, 60.0],
                excess_sigma_m: 0.5,
                excess_time_s: 10.0,
                cn0_drop_db: [5.0, 15.0],
                phase: 0.3,
            },
            slips: Slips { reacquired_flagged: 0.9, per_hour: 10.0, largest: 5 },
        }
    }
}

impl Scenario {
    /// A city of tall buildings: hardly a gap in roofs at 50 to 75° across the street (ten floors, streets of 20 to 50 m),
    /// half of the hidden satellites reflected, reflections of 0.6 with longer delays, three times as many slips.
    pub fn dense() -> Self {
        let city = Self::default();
        Self {
            canyons: Canyons { duration_s: [90.0, 150.0], mask_deg: [50.0, 75.0], gap: 0.1, ..city.canyons },
            reflections: Reflections { amplitude: 0.6, delay_m: [10.0, 30.0], cn0_drop_db: 5.0, ..city.reflections },
            nlos: Nlos { probability: 0.5, ..city.nlos },
            slips: Slips { reacquired_flagged: 0.7, per_hour: 30.0, largest: 10 },
            ..city
        }
    }

    /// Reads a scenario from TOML that messages call `file`; what it leaves out is the default.
    pub fn from_toml(file: &str, text: &str) -> Result<Self, ScenarioError> {
        over_defaults("degrade", file, text, Self::validate)
    }

    /// The scenario as TOML.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).unwrap_or_default()
    }

    /// Whether all values make sense.
    pub fn validate(&self) -> Result<(), ScenarioError> {
        let Self { canyons, reflections, nlos, slips, .. } = self;
        let pair = |key: &'static str, [least, greatest]: [f64; 2], low, high, must| {
            within(key, least, low, high, must)?;
            within(key, greatest, least, high, must)
        };
        within("canyons.start_s", canyons.start_s, 0.0, 1e6, "0…1000000 s")?;
        within("canyons.period_s", canyons.period_s, 1.0, 1e6, "1…1000000 s")?;
        let must = "two durations in order, at least 1 s and no longer than canyons.period_s";
        pair("canyons.duration_s", canyons.duration_s, 1.0, canyons.period_s, must)?;
        pair("canyons.building_s", canyons.building_s, 1.0, 1e6, "two durations in order, at least 1 s")?;
        pair("canyons.mask_deg", canyons.mask_deg, 0.0, 89.0, "two angles in order, 0…89°")?;
        within("canyons.gap", canyons.gap, 0.0, 1.0, "0…1")?;
        within("canyons.street_deg", canyons.street_deg, -360.0, 360.0, "−360…360°")?;
        within("reflections.amplitude", reflections.amplitude, 0.0, 0.9, "0…0.9")?;
        pair("reflections.severity", reflections.severity, 0.0, 10.0, "two factors in order, 0…10")?;
        pair("reflections.delay_m", reflections.delay_m, 0.0, 300.0, "two lengths in order, 0…300 m")?;
        within("reflections.time_s", reflections.time_s, 1e-3, 1e9, "at least 0.001 s")?;
        within("reflections.cn0_drop_db", reflections.cn0_drop_db, 0.0, 40.0, "0…40 dB")?;
        within("nlos.probability", nlos.probability, 0.0, 1.0, "0…1")?;
        pair("nlos.excess_m", nlos.excess_m, 0.0, 1e3, "two lengths in order, 0…1000 m")?;
        within("nlos.excess_sigma_m", nlos.excess_sigma_m, 0.0, 100.0, "0…100 m")?;
        within("nlos.excess_time_s", nlos.excess_time_s, 1e-3, 1e9, "at least 0.001 s")?;
        pair("nlos.cn0_drop_db", nlos.cn0_drop_db, 0.0, 40.0, "two losses in order, 0…40 dB")?;
        within("nlos.phase", nlos.phase, 0.0, 1.0, "0…1")?;
        within("slips.reacquired_flagged", slips.reacquired_flagged, 0.0, 1.0, "0…1")?;
        within("slips.per_hour", slips.per_hour, 0.0, 3600.0, "0…3600")?;
        within("slips.largest", slips.largest.into(), 1.0, 1e6, "1…1000000 cycles")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_valid_and_comes_back() {
        let default = Scenario::default();
        assert_eq!(Scenario::from_toml("d", &default.to_toml()).unwrap(), default);
        assert_eq!(Scenario::from_toml("d", &Scenario::dense().to_toml()).unwrap(), Scenario::dense());
        let less = Scenario::from_toml("d", "[slips]\nper_hour = 0").unwrap();
        assert_eq!(less, Scenario { slips: Slips { per_hour: 0.0, ..default.slips }, ..default });
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, expected) in [
            ("[canyons]\nmasks = 3", "c.toml: there is no `canyons.masks`; see `surefix degrade --print-default`"),
            ("seed =", "line 1"),
            (
                "[canyons]\nmask_deg = [60, 35]",
                "c.toml: scenario: canyons.mask_deg is 35, but must be two angles in order, 0…89°",
            ),
            ("[canyons]\nduration_s = [60, 400]", "canyons.duration_s is 400"),
            ("[canyons]\nperiod_s = nan", "canyons.period_s is NaN"),
            ("[nlos]\nprobability = 1.5", "nlos.probability is 1.5, but must be 0…1"),
            ("[reflections]\namplitude = 1", "reflections.amplitude is 1"),
            ("[slips]\nlargest = 0", "slips.largest is 0"),
        ] {
            let error = Scenario::from_toml("c.toml", text).unwrap_err().to_string();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }
}
