//! What adaptive noise and other settings are worth between buildings: variants of the engine's configuration on real
//! drives, degraded ([`crate::degrade`]) with several seeds or as they are.
//!
//! All variants get the same observations. Numbers of several seeds are those of all their epochs together.

use crate::compare::{Errors, Normalized, Options, Truth, compare};
use crate::degrade::scenario::Scenario;
use crate::degrade::{DegradeError, degrade};
use crate::process::run::Engine;
use crate::process::stream::Input;
use crate::read::rinex::{NavigationData, ObservationEpoch};
use crate::read::solution::Track;
use crate::simulate::scenario::merge;
use nalgebra::Vector3;
use rayon::prelude::*;
use serde::Deserialize;
use std::fmt;
use surefix_core::gnss::solution::Solution;
use surefix_core::rtk::RtkConfig;
use toml::{Table as Toml, Value};

/// The variants if no others are given.
pub const VARIANTS: &str = include_str!("urban.toml");

/// A configuration to try.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Variant {
    /// What it is called.
    pub name: String,
    /// What it changes of the default.
    #[serde(default)]
    config: Toml,
}

/// Why variants cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum VariantError {
    /// Not TOML, or not of this form.
    #[error("{0}")]
    Syntax(toml::de::Error),
    /// A setting that does not exist.
    #[error("variant \"{variant}\": there is no setting `{key}`; see RtkConfig for what there is")]
    UnknownKey {
        /// The variant.
        variant: String,
        /// The setting.
        key: String,
    },
    /// A value of the wrong kind.
    #[error("variant \"{variant}\": {problem}")]
    Value {
        /// The variant.
        variant: String,
        /// What is wrong.
        problem: String,
    },
}

impl Variant {
    /// All variants of a TOML text.
    pub fn all(text: &str) -> Result<Vec<Self>, VariantError> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct File {
            variant: Vec<Variant>,
        }
        let variants = toml::from_str::<File>(text).map_err(VariantError::Syntax)?.variant;
        variants.iter().try_for_each(|variant| variant.apply(&RtkConfig::DEFAULT).map(drop))?;
        Ok(variants)
    }

    /// A configuration with what this variant changes.
    pub fn apply(&self, to: &RtkConfig) -> Result<RtkConfig, VariantError> {
        let problem = |problem: String| VariantError::Value { variant: self.name.clone(), problem };
        let mut table = Toml::try_from(to).map_err(|error| problem(error.to_string()))?;
        let mut given = self.config.clone();
        // A choice among kinds is given whole.
        if let (Some(Value::Table(adaptation)), Some(Value::Table(given))) =
            (table.get_mut("adaptation"), given.get_mut("adaptation"))
            && let Some(forgetting) = given.remove("forgetting")
        {
            adaptation.insert("forgetting".into(), forgetting);
        }
        merge(&mut table, given).map_err(|key| VariantError::UnknownKey { variant: self.name.clone(), key })?;
        table.try_into().map_err(|error: toml::de::Error| problem(error.to_string()))
    }
}

/// A drive: what the engine is fed with, and where the rover truly was.
#[derive(Clone)]
pub struct Drive {
    /// What it is called.
    pub name: String,
    /// All inputs.
    pub inputs: Vec<Input>,
    /// Where the rover was; for a moving base where it would have been, had the base stayed at `vectors_from`.
    pub truth: Truth,
    /// Configuration of which variants change something.
    pub config: RtkConfig,
    /// For a moving base: a place on the ground from which to put the vectors, ECEF `[m]`.
    pub vectors_from: Option<Vector3<f64>>,
}

impl Drive {
    /// The drive between the buildings of a scenario.
    pub fn degraded(&self, navigation: &NavigationData, scenario: &Scenario) -> Result<Self, DegradeError> {
        let epochs: Vec<ObservationEpoch> = self
            .inputs
            .iter()
            .filter_map(|input| match input {
                Input::Rover(epoch) => Some(ObservationEpoch {
                    time: epoch.time,
                    power_failure: false,
                    clock_offset: None,
                    observations: epoch.observations.clone(),
                }),
                _ => None,
            })
            .collect();
        let mut degraded = degrade(&epochs, navigation, scenario)?.epochs.into_iter();
        let mut drive = self.clone();
        for input in &mut drive.inputs {
            if let Input::Rover(epoch) = input
                && let Some(degraded) = degraded.next()
            {
                epoch.observations = degraded.observations;
            }
        }
        Ok(drive)
    }
}

/// What a variant reaches, over one run or several.
#[derive(Clone, Debug, Default)]
pub struct Score {
    /// Epochs.
    pub epochs: f64,
    /// Fixed epochs.
    pub fixes: f64,
    /// Fixed epochs with a truth, and those of them that are wrong by more than 10 cm.
    pub wrong: [f64; 2],
    /// Squares of errors, 3-D, of all and of fixed epochs, and their numbers.
    squares: [[f64; 2]; 2],
    /// Squares of errors over standard deviations of all epochs, east, north and up, and their number.
    normalized: [f64; 4],
    /// Epochs beyond their protection levels, horizontal and vertical, and all with one.
    pub beyond: [u64; 3],
    /// Horizontal protection levels `[m]`.
    levels: Vec<f64>,
}

impl Score {
    /// Of the engine with a configuration on a drive.
    pub fn of(drive: &Drive, config: RtkConfig) -> Self {
        let mut engine = Engine::new(config);
        let mut solutions: Vec<Solution> = drive.inputs.iter().filter_map(|input| engine.feed(input)).collect();
        if let Some(place) = drive.vectors_from {
            // Only vectors count; epochs without one have no truth.
            solutions.retain(|solution| solution.base.is_some());
            for solution in &mut solutions {
                solution.position += place - solution.base.unwrap_or(place);
            }
        }
        let options = Options { alert_limits: Some([f64::INFINITY; 2]), ..Options::default() };
        let report = compare(&Track::of(&solutions), &drive.truth, &options);
        let squares = |errors: Option<Errors>| {
            errors.map_or([0.0; 2], |errors| [errors.count as f64 * errors.rms_3d_m.powi(2), errors.count as f64])
        };
        let normalized = |normalized: &Normalized| {
            let count = normalized.count as f64;
            let [east, north, up] =
                [normalized.rms.east, normalized.rms.north, normalized.rms.up].map(|rms| count * rms.powi(2));
            [east, north, up, count]
        };
        let levels = solutions.iter().filter_map(|solution| Some(solution.protection?.horizontal));
        Self {
            epochs: report.epochs as f64,
            fixes: report.fix_rate * report.epochs as f64,
            wrong: [report.wrong_fixes as f64, report.fixed.map_or(0.0, |errors| errors.count as f64)],
            squares: [squares(report.all), squares(report.fixed)],
            normalized: report.all_normalized.as_ref().map_or([0.0; 4], normalized),
            beyond: report.stanford.map_or([0; 3], |stanford| {
                [stanford.horizontal.beyond(), stanford.vertical.beyond(), stanford.horizontal.total()]
            }),
            levels: levels.collect(),
        }
    }

    /// With the epochs of another run.
    fn and(mut self, other: Self) -> Self {
        let add = |to: &mut [f64], what: &[f64]| to.iter_mut().zip(what).for_each(|(to, what)| *to += what);
        self.epochs += other.epochs;
        self.fixes += other.fixes;
        add(&mut self.wrong, &other.wrong);
        self.squares.iter_mut().zip(&other.squares).for_each(|(to, what)| add(to, what));
        add(&mut self.normalized, &other.normalized);
        self.beyond.iter_mut().zip(other.beyond).for_each(|(to, what)| *to += what);
        self.levels.extend(other.levels);
        self
    }

    /// Fixed epochs `[%]`.
    pub fn fixed_percent(&self) -> f64 {
        100.0 * self.fixes / self.epochs
    }

    /// Wrong ones of the fixed epochs `[%]`; 0 if there is none.
    pub fn wrong_percent(&self) -> f64 {
        100.0 * self.wrong[0] / self.wrong[1].max(1.0)
    }

    /// Epochs whose errors exceed their protection levels, horizontal and vertical `[%]`.
    pub fn beyond_percent(&self) -> [f64; 2] {
        let [horizontal, vertical, all] = self.beyond.map(|count| count as f64);
        [horizontal, vertical].map(|beyond| 100.0 * beyond / all)
    }

    /// Rms of 3-D errors, of all epochs and of fixed ones `[m]`.
    pub fn rms_3d(&self) -> [f64; 2] {
        self.squares.map(|[squares, count]| (squares / count).sqrt())
    }

    /// Median of the horizontal protection levels `[m]`.
    pub fn median_level(&self) -> f64 {
        let mut levels = self.levels.clone();
        levels.sort_by(f64::total_cmp);
        levels.get(levels.len() / 2).copied().unwrap_or(f64::NAN)
    }
}

/// A row of the table.
pub struct Row {
    /// Drive.
    pub drive: String,
    /// Variant.
    pub variant: String,
    /// What it reaches.
    pub score: Score,
}

/// The table.
pub struct Table(pub Vec<Row>);

/// Runs all variants over all runs of a drive, on all cores, and puts the runs together.
pub fn run(name: &str, runs: &[Drive], variants: &[Variant]) -> Result<Table, VariantError> {
    let row = |variant: &Variant| {
        let scores: Result<Vec<Score>, VariantError> =
            runs.par_iter().map(|drive| Ok(Score::of(drive, variant.apply(&drive.config)?))).collect();
        let score = scores?.into_iter().fold(Score::default(), Score::and);
        Ok(Row { drive: name.to_owned(), variant: variant.name.clone(), score })
    };
    variants.par_iter().map(row).collect::<Result<Vec<Row>, VariantError>>().map(Table)
}

impl Table {
    /// The heads of the columns.
    pub const HEAD: &str = "\
| drive            | variant                  | fix % | wrong % | rms 3D cm, all | fixed | error/σ e, n, u     | PE > PL % H | V      | HPL m |
|---|---|---|---|---|---|---|---|---|---|";
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for Row { drive, variant, score } in &self.0 {
            let [all, fixed] = score.rms_3d().map(|rms| 100.0 * rms);
            let [horizontal, vertical] = score.beyond_percent();
            let [east, north, up, count] = score.normalized;
            let [east, north, up] = [east, north, up].map(|squares| (squares / count).sqrt());
            writeln!(
                f,
                "| {drive:16} | {variant:24} | {:5.2} | {:7.2} | {all:14.2} | {fixed:5.2} | {east:5.2}, {north:5.2}, {up:5.2} \
                 | {horizontal:11.3} | {vertical:6.3} | {:5.3} |",
                score.fixed_percent(),
                score.wrong_percent(),
                score.median_level(),
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use surefix_core::filter::adaptive::forgetting::Forgetting;

    #[test]
    fn variants_change_what_they_say_and_nothing_else() {
        let variants = Variant::all(VARIANTS).unwrap();
        assert_eq!(variants[0].apply(&RtkConfig::DEFAULT).unwrap(), RtkConfig::DEFAULT);
        let by_name = |name: &str| variants.iter().find(|variant| variant.name == name).unwrap();
        let config = by_name("IAVAKF beta, channel").apply(&RtkConfig::DEFAULT).unwrap();
        assert!(config.adaptation.enabled && config.adaptation.forgetting == Forgetting::IAVAKF);
        assert_eq!(RtkConfig { adaptation: RtkConfig::DEFAULT.adaptation, ..config }, RtkConfig::DEFAULT);
        let config = by_name("ratio 3").apply(&RtkConfig::DEFAULT).unwrap();
        assert_eq!((config.acceptance.ratio, config.acceptance.success_rate), (3.0, 0.995));
    }

    #[test]
    fn variants_that_make_no_sense_are_refused() {
        for (text, expected) in [
            ("[[variant]]\nname = \"a\"\nconfig = { ratio = 3 }", "variant \"a\": there is no setting `ratio`"),
            ("[[variant]]\nname = \"b\"\nconfig = { acceptance = { ratio = \"x\" } }", "variant \"b\""),
            ("[[variants]]\nname = \"c\"", "variants"),
        ] {
            let error = Variant::all(text).unwrap_err().to_string();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }

    /// Two runs together: 1 of 4 and 3 of 4 epochs fixed; rms of errors 1 m twice and 2 m twice is √2.5 m.
    #[test]
    fn runs_are_put_together_by_epochs() {
        let score = |fixes, square, beyond, level| Score {
            epochs: 4.0,
            fixes,
            squares: [[2.0 * square, 2.0]; 2],
            beyond: [beyond, 0, 4],
            levels: vec![level; 2],
            ..Score::default()
        };
        let both = score(1.0, 1.0, 1, 0.5).and(score(3.0, 4.0, 3, 1.0));
        assert_eq!((both.fixed_percent(), both.wrong_percent(), both.beyond_percent()), (50.0, 0.0, [50.0, 0.0]));
        assert!((both.rms_3d()[0] - 2.5_f64.sqrt()).abs() < 1e-12);
        assert_eq!(both.median_level(), 1.0);
    }
}
