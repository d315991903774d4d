//! The files of a degraded drive.
//!
//! | file | what |
//! |---|---|
//! | `rover.obs` | the observations, RINEX 3.04 |
//! | `events.csv` | what was done, see [`super::events`] |
//! | `scenario.toml` | the whole scenario, defaults included |
//!
//! The header keeps marker, receiver, antenna, approximate position, signals and GLONASS channels; comments, event records
//! and receiver clock offsets are not written.

use super::scenario::Scenario;
use super::{Degraded, events};
use crate::read::rinex::ObservationHeader;
use crate::write::partial_file::PartialFile;
use crate::write::rinex_observation::{ObservationWriter, Station};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use surefix_core::gnss::satellite::Constellation;

/// A file that cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot be written ({source}); check the path, the permissions and the space", path.display())]
pub struct WriteError {
    path: PathBuf,
    source: io::Error,
}

/// Writes all files into `directory`, which is made if need be: all of them or none. Returns their names.
pub fn write(
    directory: &Path,
    header: &ObservationHeader,
    scenario: &Scenario,
    degraded: &Degraded,
) -> Result<[PathBuf; 3], WriteError> {
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |source| WriteError { path, source }
    };
    std::fs::create_dir_all(directory).map_err(failed(directory))?;
    let paths = ["rover.obs", "events.csv", "scenario.toml"].map(|name| directory.join(name));
    let [observations, list, toml] = &paths;
    let create = |path: &PathBuf| PartialFile::create(path).map_err(failed(path));
    let mut files = [create(observations)?, create(list)?, create(toml)?];
    write_observations(header, degraded, &mut files[0]).map_err(failed(observations))?;
    events::write(&degraded.events, &mut files[1]).map_err(failed(list))?;
    files[2].write_all(scenario.to_toml().as_bytes()).map_err(failed(toml))?;
    PartialFile::keep_all(files).map_err(failed(directory))?;
    Ok(paths)
}

/// Writes the observation file.
fn write_observations(header: &ObservationHeader, degraded: &Degraded, out: impl Write) -> io::Result<()> {
    let mut signals: [Vec<_>; 5] = Default::default();
    for constellation in Constellation::ALL {
        signals[constellation.index()] = header.signals(constellation).to_vec();
    }
    let station = Station {
        marker: header.marker.clone(),
        receiver: header.receiver.clone(),
        antenna: header.antenna.clone(),
        approximate_position: header.approximate_position.unwrap_or_default(),
        antenna_delta_hen: header.antenna_delta_hen,
        interval: header.interval,
        first_epoch: degraded.epochs.first().map(|epoch| epoch.time).unwrap_or_default(),
        signals,
        glonass_channels: header.glonass_channels.clone(),
    };
    let mut writer = ObservationWriter::new(out, &station)?;
    for epoch in &degraded.epochs {
        writer.write(epoch.view(), epoch.power_failure)?;
    }
    writer.finish().map(|_| ())
}
