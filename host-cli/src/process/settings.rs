//! Settings as users write them: a small TOML file with plain units, or a few options, into an [`RtkConfig`].
//!
//! Everything has a default, meant for every case; only the bands follow the receivers.

use crate::smooth::integers::{Scope, Search, Source};
use crate::smooth::rtk::Options;
use crate::smooth::rtk::fix::Fixing;
use crate::smooth::rtk::noise::TimeConstants;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use surefix_core::filter::mixed_integer::Output;
use surefix_core::gnss::satellite::Constellation;
use surefix_core::integrity::protection;
use surefix_core::model::motion::Motion;
use surefix_core::rtk::RtkConfig;
use surefix_core::rtk::config::{Adaptation, BandPlan, BaselineLength, Estimation, MAX_BANDS, Partial};

/// Settings of a run, in the units of their names.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Bands by constellation, as RINEX letters and digits: `"G12 E15 C26"`; also `"L1"`, `"L1L2"`, `"L1L2L5"`.
    pub bands: String,
    /// `"static"`, `"velocity"` (a moving rover, the default) or `"acceleration"`.
    pub motion: Motion,
    /// Density of the motion's white noise: `[m²/s³]` for `velocity`, `[m²/s⁵]` for `acceleration`.
    pub motion_noise: f64,
    /// Elevation mask `[deg]`.
    pub elevation_mask_deg: f64,
    /// Least C/N0 `[dB-Hz]`.
    pub cn0_mask_dbhz: f32,
    /// Greatest age of base data `[s]`.
    pub max_age_s: f64,
    /// Least bootstrapped success rate of a fix.
    pub fix_success_rate: f64,
    /// Least ratio of second-best to best integers of a fix.
    pub fix_ratio: f64,
    /// Satellites below this elevation are not fixed `[deg]`.
    pub fix_elevation_mask_deg: f64,
    /// What stays float where not all ambiguities can be fixed: `"weakest"` (an eighth after the other, the default),
    /// `"elevation"` or `search = { budget = 60 }` (satellites, by the success rate), or `"decorrelated"` (combinations of
    /// ambiguities are fixed).
    pub fix_partial: Partial,
    /// Whether those that are fixed help the rest.
    pub fix_assist: bool,
    /// Fewest satellites besides the references that `"elevation"` and `search` fix.
    pub fix_min_satellites: usize,
    /// Standard deviation of a code at the zenith, per receiver `[m]`.
    pub code_sigma_m: f64,
    /// Standard deviation of a carrier phase at the zenith, per receiver `[m]`.
    pub phase_sigma_m: f64,
    /// Linearisation, slip detector and kind of fixed solution, for comparisons: the defaults are the best.
    pub estimation: Estimation,
    /// The base moves, as `--moving-base` says: the answer is the vector from it.
    pub moving_base: bool,
    /// The distance between the antennas, where it is known: `length` and `sigma` `[m]`, and its `use`: `"validate"` (a fix
    /// of another length is refused) or `"measure"` (it helps the float solution).
    pub baseline_length: Option<BaselineLength>,
    /// Measurement noise that follows the data.
    pub adaptation: Adaptation,
    /// Integrity risk, how it is divided, and alert limits `[m]`.
    pub integrity: protection::Config,
    /// What `--smooth` does.
    pub smoothing: Smoothing,
}

/// Settings of smoothing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Smoothing {
    /// Learn the noise of motion and measurements from the data, as `--em` does.
    pub em: bool,
    /// With `em`: trust each measurement as its smoothed error deserves (noise with heavy tails).
    pub robust: bool,
    /// Model multipath as noise that is correlated in time.
    pub multipath: bool,
    /// How long multipath of codes lasts `[s]`.
    pub code_correlation_s: f64,
    /// How long multipath of phases lasts `[s]`.
    pub phase_correlation_s: f64,
    /// Standard deviation of the antennas' phase centres, each horizontal axis `[m]`: constant over a run, so that no data
    /// can tell it; it is added to the covariances.
    pub phase_centre_horizontal_m: f64,
    /// The same, vertical `[m]`.
    pub phase_centre_vertical_m: f64,
    /// Further starts of EM beside the configured noise, as pairs of factors on the standard deviations of motion and of
    /// measurements: `[[0.1, 10.0], [10.0, 0.1]]`. The likeliest end counts. Each costs as much time as EM before integers
    /// are fixed; they run on all cores.
    pub em_starts: Vec<[f64; 2]>,
    /// The density whose integers are fixed: `"smoother"` (given all epochs, the default) or `"filter"` (given those
    /// before).
    pub integer_source: Source,
    /// What gets one integer: an ambiguity for as long as it lasts, `"arc"` (the default), where each fix helps all
    /// epochs; or in each epoch by itself, `"epoch"`, where none helps another epoch and EM learns without integers.
    pub integer_scope: Scope,
    /// How integers are found: `"least-squares"` (the default) or `"bootstrapping"`, where `fix_success_rate` decides
    /// without `fix_ratio`. With both, the least certain ambiguities stay float until the rest is accepted.
    pub integer_search: Search,
    /// Memory for densities `[MiB]`; a record that needs more is smoothed in stretches, at the cost of time.
    pub memory_mib: u32,
}

impl Default for Smoothing {
    fn default() -> Self {
        let options = Options::default();
        Self {
            em: options.em,
            robust: options.robust,
            multipath: options.coloured,
            code_correlation_s: options.time_constants.code,
            phase_correlation_s: options.time_constants.phase,
            phase_centre_horizontal_m: options.phase_centres[0],
            phase_centre_vertical_m: options.phase_centres[1],
            em_starts: options.starts,
            integer_source: options.fixing.source,
            integer_scope: options.fixing.scope,
            integer_search: options.fixing.search,
            memory_mib: (options.budget >> 20) as u32,
        }
    }
}

impl Smoothing {
    /// The options of the smoother.
    pub fn options(&self) -> Result<Options, SettingsError> {
        let above = |name, value: f64| check(name, value, value.is_finite() && value > 0.0, "give a number above 0");
        let sigma = |name, value: f64| check(name, value, (0.0..1.0).contains(&value), "give metres from 0 to below 1");
        above("smoothing.memory_mib", self.memory_mib.into())?;
        let factor = |value: f64| {
            let remedy = "give pairs of factors from 0.001 to 1000, for motion and measurements, as in [[0.1, 10.0]]";
            check("smoothing.em_starts", value, (1e-3..=1e3).contains(&value), remedy)
        };
        self.em_starts.iter().flatten().try_for_each(|&value| factor(value).map(drop))?;
        Ok(Options {
            em: self.em,
            robust: self.robust,
            budget: (self.memory_mib as usize) << 20,
            coloured: self.multipath,
            time_constants: TimeConstants {
                code: above("smoothing.code_correlation_s", self.code_correlation_s)?,
                phase: above("smoothing.phase_correlation_s", self.phase_correlation_s)?,
            },
            phase_centres: [
                sigma("smoothing.phase_centre_horizontal_m", self.phase_centre_horizontal_m)?,
                sigma("smoothing.phase_centre_vertical_m", self.phase_centre_vertical_m)?,
            ],
            starts: self.em_starts.clone(),
            fixing: Fixing { source: self.integer_source, scope: self.integer_scope, search: self.integer_search },
            ..Options::default()
        })
    }
}

/// A value, or the remedy if it is not good.
fn check(name: &'static str, value: f64, good: bool, remedy: &'static str) -> Result<f64, SettingsError> {
    if good { Ok(value) } else { Err(SettingsError::Value { name, value: value.to_string(), remedy }) }
}

impl Default for Settings {
    fn default() -> Self {
        let config = RtkConfig::default();
        Self {
            bands: "L1L2".into(),
            motion: config.motion,
            motion_noise: config.motion_noise,
            elevation_mask_deg: degrees(config.elevation_mask),
            cn0_mask_dbhz: config.cn0_mask,
            max_age_s: config.max_age,
            fix_success_rate: config.acceptance.success_rate,
            fix_ratio: config.acceptance.ratio,
            fix_elevation_mask_deg: degrees(config.acceptance.elevation_mask),
            fix_partial: config.acceptance.partial,
            fix_assist: config.acceptance.assist,
            fix_min_satellites: config.acceptance.min_satellites,
            code_sigma_m: zenith(config.code.constant, config.code.elevation),
            phase_sigma_m: zenith(config.phase.constant, config.phase.elevation),
            estimation: config.estimation,
            moving_base: config.moving_base,
            baseline_length: config.baseline_length,
            adaptation: config.adaptation,
            integrity: config.integrity,
            smoothing: Smoothing::default(),
        }
    }
}

/// An angle in degrees, without the last digits that the conversion from radians leaves.
fn degrees(radians: f64) -> f64 {
    (radians.to_degrees() * 1e9).round() / 1e9
}

/// Standard deviation at the zenith of a noise with the given two parts.
fn zenith(constant: f64, elevation: f64) -> f64 {
    (constant.hypot(elevation) * 1e9).round() / 1e9
}

/// What is wrong with settings. Messages contain their causes, which are therefore no `source`: nobody says them twice.
#[derive(Debug, thiserror::Error)]
pub enum SettingsError {
    /// The file cannot be read.
    #[error("{file}: cannot be read: {cause}", file = file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// Why.
        cause: std::io::Error,
    },
    /// The file is no valid TOML, or has an unknown or wrong field; the message of the parser names line and field.
    #[error("{file}: {cause}", file = file.display())]
    Syntax {
        /// The file.
        file: PathBuf,
        /// Why.
        cause: Box<toml::de::Error>,
    },
    /// A value in a file makes no sense.
    #[error("{file}: {cause}", file = file.display())]
    InFile {
        /// The file.
        file: PathBuf,
        /// Which value, and what to write instead.
        cause: Box<SettingsError>,
    },
    /// Risk or alert limits make no sense, or contradict each other.
    #[error("integrity: {cause}")]
    Integrity {
        /// Which, why, and what to write instead.
        cause: protection::ConfigError,
    },
    /// A value makes no sense.
    #[error("{name} = {value}: {remedy}")]
    Value {
        /// The setting.
        name: &'static str,
        /// Its value.
        value: String,
        /// What to write instead.
        remedy: &'static str,
    },
}

impl Settings {
    /// Reads a TOML file and checks its values.
    pub fn read(file: &Path) -> Result<Self, SettingsError> {
        let text = std::fs::read_to_string(file).map_err(|cause| SettingsError::Read { file: file.into(), cause })?;
        let settings: Self = toml::from_str(&text)
            .map_err(|cause| SettingsError::Syntax { file: file.into(), cause: Box::new(cause) })?;
        let checked = settings.config().and_then(|_| settings.smoothing.options());
        checked.map_err(|cause| SettingsError::InFile { file: file.into(), cause: Box::new(cause) })?;
        Ok(settings)
    }

    /// The configuration of the engine.
    pub fn config(&self) -> Result<RtkConfig, SettingsError> {
        let positive = |name, v: f64| check(name, v, v.is_finite() && v > 0.0, "give a number above 0");
        let angle = |name, v: f64| check(name, v, (0.0..90.0).contains(&v), "give degrees from 0 to below 90");
        let mut config = RtkConfig {
            bands: parse_bands(&self.bands)?,
            motion: self.motion,
            motion_noise: positive("motion_noise", self.motion_noise)?,
            elevation_mask: angle("elevation_mask_deg", self.elevation_mask_deg)?.to_radians(),
            cn0_mask: self.cn0_mask_dbhz,
            max_age: positive("max_age_s", self.max_age_s)?,
            estimation: self.estimation,
            moving_base: self.moving_base,
            baseline_length: self.baseline_length.map(|known| known_length(&known)).transpose()?,
            adaptation: sound(&self.adaptation)?,
            integrity: self.integrity,
            ..RtkConfig::default()
        };
        self.integrity.factors().map_err(|cause| SettingsError::Integrity { cause })?;
        let rate = self.fix_success_rate;
        config.acceptance.success_rate =
            check("fix_success_rate", rate, (0.0..1.0).contains(&rate), "give a probability from 0 to below 1")?;
        config.acceptance.ratio =
            check("fix_ratio", self.fix_ratio, self.fix_ratio >= 1.0, "give a ratio of 1 or more")?;
        config.acceptance.elevation_mask = angle("fix_elevation_mask_deg", self.fix_elevation_mask_deg)?.to_radians();
        (config.acceptance.partial, config.acceptance.assist) = (self.partial()?, self.fix_assist);
        config.acceptance.min_satellites = self.fix_min_satellites;
        let default = Self::default();
        let scale_code = positive("code_sigma_m", self.code_sigma_m)? / default.code_sigma_m;
        let scale_phase = positive("phase_sigma_m", self.phase_sigma_m)? / default.phase_sigma_m;
        for (noise, scale) in [(&mut config.code, scale_code), (&mut config.phase, scale_phase)] {
            noise.constant *= scale;
            noise.elevation *= scale;
        }
        Ok(config)
    }
}

impl Settings {
    /// How to fix a part, if that makes sense with the rest.
    fn partial(&self) -> Result<Partial, SettingsError> {
        let partial = self.fix_partial;
        let refuse = |remedy| Err(SettingsError::Value { name: "fix_partial", value: format!("{partial:?}"), remedy });
        match partial {
            Partial::Search { budget: 0 } => refuse("give a budget of 1 or more, as in search = { budget = 60 }"),
            Partial::Decorrelated if self.estimation.output == Output::DualDensity => refuse(
                "fixes combinations, where estimation.output = \"dual-density\" needs single ambiguities; change one of them",
            ),
            Partial::Decorrelated if self.fix_assist => {
                refuse("fixes combinations, which cannot help single ambiguities; leave fix_assist out")
            }
            Partial::Elevation | Partial::Search { .. } if self.fix_min_satellites == 0 => {
                refuse("fixes satellites; give fix_min_satellites of 1 or more")
            }
            _ => Ok(partial),
        }
    }
}

/// A known length whose numbers make sense together.
fn known_length(known: &BaselineLength) -> Result<BaselineLength, SettingsError> {
    let (length, sigma) = (known.length, known.sigma);
    check("baseline_length.length", length, length.is_finite() && length > 0.0, "give metres above 0")?;
    let remedy = "give metres above 0, and less than the length itself";
    check("baseline_length.sigma", sigma, sigma > 0.0 && sigma < length, remedy)?;
    Ok(*known)
}

/// Adaptation whose numbers make sense together.
fn sound(adaptation: &Adaptation) -> Result<Adaptation, SettingsError> {
    let [low, high] = adaptation.bounds;
    check(
        "adaptation.bounds",
        low,
        low > 0.0 && low <= high && high.is_finite(),
        "give two numbers above 0, the smaller first",
    )?;
    if adaptation.forgetting.is_sound() {
        return Ok(*adaptation);
    }
    let value = format!("{:?}", adaptation.forgetting);
    let remedy = "give b and threshold above 0 and below 1, and bounds from 0 to 1, the smaller first";
    Err(SettingsError::Value { name: "adaptation.forgetting", value, remedy })
}

/// A band plan from its text: `L1`, `L1L2`, `L1L2L5`, or constellations with their RINEX bands (`G12 E15`).
pub fn parse_bands(text: &str) -> Result<BandPlan, SettingsError> {
    let wrong = || SettingsError::Value {
        name: "bands",
        value: format!("{text:?}"),
        remedy: "write L1, L1L2, L1L2L5, or constellation letters with up to three RINEX band digits, as in \"G12 E15\"",
    };
    match text.trim().to_ascii_uppercase().as_str() {
        "L1" => return Ok(BandPlan::L1),
        "L1L2" => return Ok(BandPlan::L1L2),
        "L1L2L5" => return Ok(BandPlan::L1L2L5),
        _ => {}
    }
    let mut plan = BandPlan::EMPTY;
    let mut any = false;
    for word in text.split_whitespace() {
        let mut letters = word.chars();
        let constellation = letters.next().and_then(Constellation::from_letter).ok_or_else(wrong)?;
        let digits = letters.as_str().as_bytes();
        if digits.is_empty() || digits.len() > MAX_BANDS || !digits.iter().all(|digit| (b'1'..=b'9').contains(digit)) {
            return Err(wrong());
        }
        plan = plan.with(constellation, digits);
        any = true;
    }
    if any { Ok(plan) } else { Err(wrong()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_settings_are_the_default_configuration() {
        let config = Settings::default().config().unwrap();
        let default = RtkConfig::default();
        assert_eq!(config.bands, default.bands);
        assert_eq!((config.code, config.phase), (default.code, default.phase));
        assert!((config.elevation_mask - default.elevation_mask).abs() < 1e-12);
        assert!((config.acceptance.elevation_mask - default.acceptance.elevation_mask).abs() < 1e-12);
        assert_eq!(config.acceptance.ratio, default.acceptance.ratio);
        assert_eq!(Smoothing::default().options().unwrap(), Options::default());
    }

    #[test]
    fn bands_are_read_from_names_and_from_letters() {
        assert_eq!(parse_bands("l1").unwrap(), BandPlan::L1);
        let plan = parse_bands("G12 E15").unwrap();
        assert_eq!(plan.bands(Constellation::Gps).collect::<Vec<_>>(), b"12");
        assert_eq!(plan.bands(Constellation::Galileo).collect::<Vec<_>>(), b"15");
        assert_eq!(plan.bands(Constellation::BeiDou).count(), 0);
        for bad in ["", "G", "X1", "G1234", "G0", "12"] {
            assert!(parse_bands(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn smoothing_is_set_by_names() {
        let text = "[smoothing]\nem_starts = [[0.1, 10]]\ninteger_source = \"filter\"\ninteger_scope = \"epoch\"\n\
                    integer_search = \"bootstrapping\"";
        let options = toml::from_str::<Settings>(text).unwrap().smoothing.options().unwrap();
        let fixing = Fixing { source: Source::Filter, scope: Scope::Epoch, search: Search::Bootstrapping };
        assert_eq!(options, Options { starts: vec![[0.1, 10.0]], fixing, ..Options::default() });
        let default = Fixing { source: Source::Smoother, scope: Scope::Arc, search: Search::LeastSquares };
        assert_eq!(Options::default().fixing, default);
        let text = toml::to_string(&Settings::default()).unwrap();
        assert!(
            text.contains("integer_source = \"smoother\"\ninteger_scope = \"arc\"\ninteger_search = \"least-squares\"")
        );
    }

    #[test]
    fn wrong_values_and_unknown_fields_are_named() {
        let settings: Settings = toml::from_str("elevation_mask_deg = 95.0").unwrap();
        assert!(settings.config().unwrap_err().to_string().starts_with("elevation_mask_deg = 95"));
        let settings: Settings = toml::from_str("[smoothing]\nphase_correlation_s = -1.0").unwrap();
        let error = settings.smoothing.options().unwrap_err().to_string();
        assert!(error.starts_with("smoothing.phase_correlation_s = -1: give a number above 0"), "{error}");
        let settings: Settings = toml::from_str("[smoothing]\nem_starts = [[0.1, 10], [0, 1]]").unwrap();
        let error = settings.smoothing.options().unwrap_err().to_string();
        assert!(error.starts_with("smoothing.em_starts = 0: give pairs of factors from 0.001 to 1000"), "{error}");
        let error = toml::from_str::<Settings>("[smoothing]\ninteger_source = \"both\"").unwrap_err().to_string();
        for part in ["integer_source = \"both\"", "expected `filter` or `smoother`"] {
            assert!(error.contains(part), "{part:?} is not in {error}");
        }
        for (text, part) in [
            ("[integrity.allocation]\nrisk = 1.5", "integrity: the integrity risk is a probability"),
            (
                "[integrity.allocation]\nrisk = 1e-7\nwrong_fix = 1e-6",
                "risk of wrong integers is a part of the integrity risk",
            ),
            ("[integrity]\nalert_limits = [0.0, 1.0]", "integrity: an alert limit is a distance"),
            ("[adaptation]\nbounds = [9.0, 1.0]", "adaptation.bounds = 9: give two numbers above 0"),
            ("[integrity.fault]\np_md = 0.0", "integrity: fault.p_fa and fault.p_md are probabilities"),
            (
                "[baseline_length]\nlength = 0.0\nsigma = 0.1\nuse = \"measure\"",
                "baseline_length.length = 0: give metres above 0",
            ),
            (
                "[baseline_length]\nlength = 1.6\nsigma = 2.0\nuse = \"validate\"",
                "baseline_length.sigma = 2: give metres above 0, and less than the length",
            ),
            ("[fix_partial.search]\nbudget = 0", "fix_partial = Search { budget: 0 }: give a budget of 1"),
            ("fix_partial = \"decorrelated\"\nfix_assist = true", "cannot help single ambiguities"),
            (
                "fix_partial = \"decorrelated\"\nestimation.output = \"dual-density\"",
                "needs single ambiguities; change one of them",
            ),
            ("fix_partial = \"elevation\"\nfix_min_satellites = 0", "give fix_min_satellites of 1 or more"),
            ("[adaptation.forgetting.sage_husa]\nb = 1.0", "adaptation.forgetting = SageHusa { b: 1.0 }: give b"),
        ] {
            let error = toml::from_str::<Settings>(text).unwrap().config().unwrap_err().to_string();
            assert!(error.contains(part), "{part:?} is not in {error}");
        }
        assert!(Settings { fix_ratio: f64::NAN, ..Settings::default() }.config().is_err());
        let error = toml::from_str::<Settings>("elevation_mask = 10").unwrap_err().to_string();
        assert!(error.contains("unknown field `elevation_mask`"), "{error}");
    }
}
