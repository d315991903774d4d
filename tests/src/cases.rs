//! The table `cases.toml`: real observations with a truth, and what must be reached on them. The head of that file says
//! what its fields mean.
//!
//! `xtask` has this file too, so that it builds without the rest of this crate.

use serde::Deserialize;

/// A row of the table.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Case {
    /// What it is called.
    pub name: String,
    /// Directory below that of the real data.
    pub directory: String,
    /// File of the rover.
    pub rover: String,
    /// File of the base.
    pub base: String,
    /// Navigation files.
    pub navigation: Vec<String>,
    /// ECEF coordinate of the base's marker `[m]`.
    pub base_xyz: [f64; 3],
    /// Heights of the antennas of rover and base above their markers `[m]`.
    pub antennas_m: Option<[f64; 2]>,
    /// Bands.
    pub bands: String,
    /// `"static"`, or none for a moving rover.
    pub motion: Option<String>,
    /// Where the rover truly is.
    pub truth: Reference,
    /// What another program reaches, in words.
    pub peer: String,
    /// What the filter must reach.
    pub limits: Limits,
    /// What it reaches where a limit is not kept.
    pub shortfall: Option<Limits>,
    /// The same for `--smooth --em`.
    pub smooth: Option<Smooth>,
}

/// Where the rover's marker truly is.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reference {
    /// ECEF coordinate `[m]`.
    pub xyz: Option<[f64; 3]>,
    /// File of a track.
    pub file: Option<String>,
    /// Only rows of the track with this quality.
    pub quality: Option<String>,
}

/// What smoothing must reach.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Smooth {
    /// What another program's smoother reaches, in words.
    pub peer: String,
    /// The limits.
    pub limits: Limits,
    /// What is reached where a limit is not kept.
    pub shortfall: Option<Limits>,
}

/// What must be reached; nothing is asked where there is none.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Fixed epochs, at least.
    pub fixed_percent: Option<f64>,
    /// Of the fixed ones, those that are wrong.
    pub wrong_percent: Option<f64>,
    /// Root mean square error, horizontal.
    pub horizontal_cm: Option<f64>,
    /// Root mean square error, all components.
    pub three_d_cm: Option<f64>,
    /// Error that 95 % of the epochs do not exceed, all components.
    pub three_d_p95_cm: Option<f64>,
    /// Least and greatest rms of the errors north and east over their standard deviations.
    pub normalized_horizontal: Option<[f64; 2]>,
    /// The same, up.
    pub normalized_up: Option<[f64; 2]>,
    /// Time to the first fix.
    pub first_fix_s: Option<f64>,
    /// Epochs with a component beyond ten of its standard deviations.
    pub beyond_10_sigma: Option<usize>,
}

/// All cases, in the order of the file.
pub fn cases() -> Result<Vec<Case>, toml::de::Error> {
    #[derive(Deserialize)]
    struct Table {
        case: Vec<Case>,
    }
    toml::from_str::<Table>(include_str!("../cases.toml")).map(|table| table.case)
}
