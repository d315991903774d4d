//! The settings of the engine as arguments of a command.

use crate::process::settings::Settings;
use std::path::PathBuf;
use surefix_core::model::motion::Motion;
use surefix_core::rtk::RtkConfig;

/// How to process. Options override the file, the file overrides the defaults.
#[derive(clap::Args, Debug, Default)]
pub struct EngineArgs {
    /// Settings, a TOML file; `surefix post --print-config` shows all of them with their defaults
    #[arg(long, value_name = "FILE.toml")]
    pub config: Option<PathBuf>,
    /// Bands: L1, L1L2 (default), L1L2L5, or by constellation as in "G12 E15" (RINEX letters and band digits)
    #[arg(long)]
    pub bands: Option<String>,
    /// The rover does not move
    #[arg(long = "static")]
    pub is_static: bool,
    /// Elevation mask in degrees
    #[arg(long, value_name = "DEG")]
    pub mask: Option<f64>,
}

impl EngineArgs {
    /// The settings that these arguments say.
    pub fn settings(&self) -> anyhow::Result<Settings> {
        let mut settings = match &self.config {
            Some(file) => Settings::read(file)?,
            None => Settings::default(),
        };
        if let Some(bands) = &self.bands {
            settings.bands.clone_from(bands);
        }
        if self.is_static {
            settings.motion = Motion::Static;
        }
        if let Some(mask) = self.mask {
            settings.elevation_mask_deg = mask;
        }
        Ok(settings)
    }

    /// The configuration of the engine that these arguments say.
    pub fn rtk_config(&self) -> anyhow::Result<RtkConfig> {
        Ok(self.settings()?.config()?)
    }
}
