//! The files of a simulation: RINEX, device log, truth.
//!
//! | file | what |
//! |---|---|
//! | `rover.obs`, `base.obs` | RINEX 3.04 observations; the base's header has its exact coordinate |
//! | `broadcast.nav` | RINEX 3.04 navigation messages |
//! | `device.log` | the same as a device log, base epochs late by the scenario's latency |
//! | `truth.csv` | position, velocity and clock at each rover epoch |
//! | `slips.csv` | every change of an ambiguity, of rover and base |
//! | `scenario.toml` | the whole scenario, defaults included |

use super::scenario::Scenario;
use super::tracking::{AmbiguityChange, Change};
use super::{KLOBUCHAR, Simulation, Truth};
use crate::log::LogWriter;
use crate::process::stream::{Input, OwnedEpoch};
use crate::write::rinex_navigation::write_navigation;
use crate::write::rinex_observation::{ObservationWriter, Station};
use nalgebra::Vector3;
use serde::Serialize;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use surefix_core::gnss::satellite::Constellation;
use surefix_core::gnss::signal::Signal;
use surefix_core::gnss::time::GpsTime;
use surefix_core::log::{Header, Ionosphere};

/// A device gets an ephemeris that long before its reference time `[s]`, half the time between updates.
const EPHEMERIS_LEAD_S: f64 = 3_600.0;

/// Where the files are.
#[derive(Clone, Debug)]
pub struct Files {
    /// Rover observations.
    pub rover: PathBuf,
    /// Base observations.
    pub base: PathBuf,
    /// Navigation messages.
    pub navigation: PathBuf,
    /// Device log.
    pub log: PathBuf,
    /// Truth.
    pub truth: PathBuf,
    /// Changes of ambiguities.
    pub slips: PathBuf,
    /// Scenario.
    pub scenario: PathBuf,
}

/// A file that cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot be written ({source}); check the path, the permissions and the space", path.display())]
pub struct WriteError {
    path: PathBuf,
    source: io::Error,
}

impl Files {
    /// The files' names in a directory.
    pub fn within(directory: &Path) -> Self {
        let file = |name: &str| directory.join(name);
        Self {
            rover: file("rover.obs"),
            base: file("base.obs"),
            navigation: file("broadcast.nav"),
            log: file("device.log"),
            truth: file("truth.csv"),
            slips: file("slips.csv"),
            scenario: file("scenario.toml"),
        }
    }

    /// Writes all files into `directory`, which is made if need be.
    pub fn write(directory: &Path, scenario: &Scenario, simulation: &Simulation) -> Result<Self, WriteError> {
        let files = Self::within(directory);
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |source| WriteError { path, source }
        };
        fs::create_dir_all(directory).map_err(failed(directory))?;
        let create = |path: &Path| File::create(path).map(BufWriter::new).map_err(failed(path));

        let start = simulation.truth.first().map_or(simulation.base_position, |truth| truth.position.map(f64::round));
        let stations = [
            (&files.rover, "ROVER", &simulation.rover, start, scenario.rover.receiver.interval_s),
            (&files.base, "BASE", &simulation.base, simulation.base_position, scenario.base.receiver.interval_s),
        ];
        for (path, name, epochs, position, interval) in stations {
            let out = create(path)?;
            write_observations(scenario, name, epochs, &position, interval, out).map_err(failed(path))?;
        }
        let mut klobuchar = [None; 5];
        klobuchar[Constellation::Gps.index()] = Some(KLOBUCHAR);
        write_navigation(create(&files.navigation)?, &simulation.ephemerides, &klobuchar)
            .map_err(failed(&files.navigation))?;
        write_log(scenario, simulation, create(&files.log)?).map_err(failed(&files.log))?;
        write_truth(&simulation.truth, create(&files.truth)?).map_err(failed(&files.truth))?;
        write_changes(simulation, create(&files.slips)?).map_err(failed(&files.slips))?;
        fs::write(&files.scenario, scenario.to_toml()).map_err(failed(&files.scenario))?;
        Ok(files)
    }
}

/// Writes an observation file.
fn write_observations(
    scenario: &Scenario,
    name: &str,
    epochs: &[OwnedEpoch],
    position: &Vector3<f64>,
    interval: f64,
    out: impl Write,
) -> io::Result<()> {
    let mut signals: [Vec<Signal>; 5] = Default::default();
    for constellation in Constellation::ALL {
        signals[constellation.index()] = scenario.signals(constellation).map_err(io::Error::other)?;
    }
    let station = Station {
        marker: name.to_owned(),
        receiver: "SUREFIX SIMULATOR".to_owned(),
        antenna: "NONE".to_owned(),
        approximate_position: (*position).into(),
        antenna_delta_hen: [0.0; 3],
        interval: Some(interval),
        first_epoch: epochs.first().map_or_else(|| scenario.start(), |epoch| epoch.time),
        signals,
        glonass_channels: Default::default(),
    };
    let mut writer = ObservationWriter::new(out, &station)?;
    for epoch in epochs {
        writer.write(epoch.view(), false)?;
    }
    writer.finish().map(|_| ())
}

/// Writes a device log, its records in the order in which they arrive at the rover.
fn write_log(scenario: &Scenario, simulation: &Simulation, out: impl Write) -> io::Result<()> {
    let position = Some(simulation.base_position.into());
    let ionosphere = Ionosphere { constellation: Constellation::Gps, klobuchar: KLOBUCHAR };
    let begin = scenario.start();
    let mut arrivals: Vec<(GpsTime, Input)> = vec![
        (begin, Input::Header(Header { base_position: position, ..Header::default() })),
        (begin, Input::Ionosphere(ionosphere)),
    ];
    arrivals.extend(simulation.ephemerides.iter().map(|ephemeris| {
        let arrives = ephemeris.toe().plus_seconds(-EPHEMERIS_LEAD_S).max(begin);
        (arrives, Input::Ephemeris(*ephemeris))
    }));
    let latency = scenario.base.latency_s;
    arrivals.extend(simulation.base.iter().map(|epoch| (epoch.time.plus_seconds(latency), Input::Base(epoch.clone()))));
    arrivals.extend(simulation.rover.iter().map(|epoch| (epoch.time, Input::Rover(epoch.clone()))));
    arrivals.sort_by_key(|(time, _)| *time); // stable: what was listed first comes first

    let mut log = LogWriter::new(out);
    arrivals.iter().try_for_each(|(_, input)| log.input(input))?;
    log.finish().map(|_| ())
}

/// A row of the truth.
#[derive(Serialize)]
struct TruthRow {
    gps_week: i32,
    gps_tow_s: f64,
    x_m: f64,
    y_m: f64,
    z_m: f64,
    vx_m_s: f64,
    vy_m_s: f64,
    vz_m_s: f64,
    clock_s: f64,
}

/// Writes the truth, a row for each rover epoch.
fn write_truth(truth: &[Truth], out: impl Write) -> io::Result<()> {
    let mut table = ::csv::Writer::from_writer(out);
    for Truth { time, position, velocity, clock } in truth {
        table.serialize(TruthRow {
            gps_week: time.week(),
            gps_tow_s: time.tow(),
            x_m: position.x,
            y_m: position.y,
            z_m: position.z,
            vx_m_s: velocity.x,
            vy_m_s: velocity.y,
            vz_m_s: velocity.z,
            clock_s: *clock,
        })?;
    }
    table.flush()
}

/// A row of the changes of ambiguities, in the order of [`CHANGE_COLUMNS`].
#[derive(Serialize)]
struct ChangeRow {
    station: &'static str,
    gps_week: i32,
    gps_tow_s: f64,
    satellite: String,
    signal: String,
    cycles: f64,
    flagged: bool,
    change: Change,
}

/// Columns of the changes of ambiguities: there is a header row even if there is no change.
const CHANGE_COLUMNS: [&str; 8] =
    ["station", "gps_week", "gps_tow_s", "satellite", "signal", "cycles", "flagged", "change"];

/// Writes the changes of ambiguities of both stations.
fn write_changes(simulation: &Simulation, out: impl Write) -> io::Result<()> {
    let mut table = ::csv::WriterBuilder::new().has_headers(false).from_writer(out);
    table.write_record(CHANGE_COLUMNS)?;
    let row = |station: &'static str, change: &AmbiguityChange| ChangeRow {
        station,
        gps_week: change.time.week(),
        gps_tow_s: change.time.tow(),
        satellite: change.satellite.to_string(),
        signal: change.signal.to_string(),
        cycles: change.cycles,
        flagged: change.flagged,
        change: change.change,
    };
    for (station, changes) in [("rover", &simulation.rover_changes), ("base", &simulation.base_changes)] {
        changes.iter().try_for_each(|change| table.serialize(row(station, change)))?;
    }
    table.flush()
}

#[cfg(test)]
mod tests {
    use super::super::simulate;
    use super::*;
    use crate::log::LogInputs;
    use crate::read::rinex::{NavigationData, ObservationReader};
    use crate::read::solution;

    #[test]
    fn files_read_back_are_the_simulation() {
        let directory = tempfile::tempdir().unwrap();
        let scenario = Scenario { duration_s: 20.0, ..Scenario::default() };
        let simulation = simulate(&scenario).unwrap();
        let files = Files::write(directory.path(), &scenario, &simulation).unwrap();

        let epochs = |path: &Path| {
            let mut reader = ObservationReader::open(path).unwrap();
            let mut epochs = Vec::new();
            while let Some(epoch) = reader.next_epoch().unwrap() {
                epochs.push(OwnedEpoch::from(epoch.view()));
            }
            assert!(reader.report().dropped.is_empty(), "{}", reader.report());
            (epochs, reader.header().approximate_position)
        };
        let sorted = |epochs: &[OwnedEpoch]| {
            let mut epochs = epochs.to_vec();
            epochs.iter_mut().for_each(|epoch| epoch.observations.sort_by_key(|o| (o.satellite, o.signal)));
            epochs
        };
        let (rover, _) = epochs(&files.rover);
        assert_eq!(sorted(&rover), sorted(&simulation.rover));
        let (base, position) = epochs(&files.base);
        assert_eq!(sorted(&base), sorted(&simulation.base));
        assert_eq!(Vector3::from(position.unwrap()), simulation.base_position);

        let navigation = NavigationData::open(&files.navigation).unwrap();
        assert_eq!(navigation.ephemerides, simulation.ephemerides);
        let truth = solution::read(&files.truth, &solution::Options::default()).unwrap();
        assert_eq!(truth.points.len(), simulation.truth.len());
        assert_eq!(truth.points[7].position, simulation.truth[7].position);
        assert_eq!(truth.points[7].velocity, Some(simulation.truth[7].velocity));
        let text = fs::read_to_string(&files.scenario).unwrap();
        assert_eq!(Scenario::from_toml("scenario", &text).unwrap(), scenario);

        let inputs: Vec<Input> = LogInputs::open(&files.log).unwrap().map(Result::unwrap).collect();
        let of_rover = inputs.iter().filter_map(|input| match input {
            Input::Rover(epoch) => Some(epoch.clone()),
            _ => None,
        });
        assert_eq!(of_rover.collect::<Vec<_>>(), simulation.rover);
        // A base epoch comes 0.3 s late: after the rover epoch of the same time.
        let stations: Vec<char> = inputs
            .iter()
            .filter_map(|input| match input {
                Input::Rover(_) => Some('r'),
                Input::Base(_) => Some('b'),
                _ => None,
            })
            .collect();
        assert_eq!(stations[..4], ['r', 'b', 'r', 'b']);
    }
}
