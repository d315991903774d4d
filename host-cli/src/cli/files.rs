//! The files of a relative solution as arguments of a command, and the stream of inputs that they make.

use crate::process::stream::{Merge, OwnedEpoch};
use crate::read::ReadError;
use crate::read::rinex::{NavigationData, ObservationReader};
use anyhow::{Context, bail};
use std::ops::RangeInclusive;
use std::path::PathBuf;
use surefix_core::gnss::atmosphere::Klobuchar;
use surefix_core::gnss::satellite::Constellation;
use surefix_core::log::{Header, Ionosphere};

/// Distances from the geocentre at which a base can be `[m]`.
const RADII: RangeInclusive<f64> = 6.30e6..=6.43e6;
/// A coordinate farther than this from the approximate one in the header is doubtful `[m]`.
const DOUBTFUL: f64 = 1_000.0;

/// Files of rover, base and navigation messages.
#[derive(clap::Args, Debug)]
pub struct Files {
    /// Observations of the rover: RINEX 2 or 3, plain, gzipped or compact (Hatanaka)
    pub rover: PathBuf,
    /// Observations of the base, likewise
    pub base: PathBuf,
    /// Navigation messages (RINEX 2 or 3, plain or gzipped), one file or more
    #[arg(value_name = "NAV", required = true)]
    pub navigation: Vec<PathBuf>,
    /// Coordinate of the base marker, ECEF metres; without it the one in the header of BASE is used
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_negative_numbers = true)]
    pub base_xyz: Option<Vec<f64>>,
    /// Antenna reference point of the base from its marker, metres; without it the offset in the header of BASE is used.
    /// Give 0 0 0 if the coordinate is that of the antenna
    #[arg(long, num_args = 3, value_names = ["UP", "EAST", "NORTH"], allow_negative_numbers = true)]
    pub base_antenna: Option<Vec<f64>>,
    /// The base moves: where it is, its own observations say, and results are vectors from it between the antennas
    #[arg(long, conflicts_with = "base_xyz")]
    pub moving_base: bool,
}

/// Files that were opened, their headers read.
pub struct OpenFiles {
    /// Observations of the rover.
    pub rover: ObservationReader,
    /// Observations of the base.
    pub base: ObservationReader,
    /// Navigation messages.
    pub navigation: NavigationData,
    /// What is known of the stations.
    pub header: Header,
    /// What the user should know: where a coordinate comes from, what is doubtful about it.
    pub warnings: Vec<String>,
}

impl Files {
    /// Opens the files and finds the coordinate of the base, unless it moves.
    pub fn open(&self) -> anyhow::Result<OpenFiles> {
        self.open_for(self.moving_base)
    }

    /// The same, for a base that moves or not, whatever the arguments say.
    pub fn open_for(&self, moving_base: bool) -> anyhow::Result<OpenFiles> {
        let rover = ObservationReader::open(&self.rover)?;
        let base = ObservationReader::open(&self.base)?;
        let mut navigation = NavigationData::default();
        for path in &self.navigation {
            navigation.merge(NavigationData::open(path)?);
        }
        let mut warnings = Vec::new();
        let base_position = if moving_base {
            None
        } else {
            Some(self.base_position(base.header().approximate_position, &mut warnings)?)
        };
        let base_antenna = self.base_antenna.as_ref().map(|offset| offset.as_slice().try_into()).transpose()?;
        let header = Header {
            base_position,
            base_antenna: base_antenna.unwrap_or(base.header().antenna_delta_hen),
            rover_antenna: rover.header().antenna_delta_hen,
        };
        Ok(OpenFiles { rover, base, navigation, header, warnings })
    }

    fn base_position(&self, approximate: Option<[f64; 3]>, warnings: &mut Vec<String>) -> anyhow::Result<[f64; 3]> {
        let given = self.base_xyz.as_ref().map(|xyz| xyz.as_slice().try_into()).transpose()?;
        let base = self.base.display();
        let position: [f64; 3] = given.or(approximate).with_context(|| {
            format!("{base}: its header has no APPROX POSITION XYZ; give the coordinate by --base-xyz X Y Z")
        })?;
        let [x, y, z] = position;
        if !RADII.contains(&norm(position)) {
            bail!("the base coordinate {x} {y} {z} is not near the ground; give ECEF metres by --base-xyz X Y Z");
        }
        match (given, approximate) {
            (None, _) => warnings.push(format!(
                "base coordinate {x:.4} {y:.4} {z:.4} is that in the header of {base}; if it is only approximate, \
                 positions are off by as much (give --base-xyz X Y Z)"
            )),
            (Some(given), Some(header)) => {
                let distance = norm([given[0] - header[0], given[1] - header[1], given[2] - header[2]]);
                if distance > DOUBTFUL {
                    warnings.push(format!(
                        "--base-xyz is {:.1} km from the approximate position in the header of {base}; is it the \
                         coordinate of this base?",
                        distance / 1000.0
                    ));
                }
            }
            (Some(_), None) => {}
        }
        Ok(position)
    }
}

fn norm(xyz: [f64; 3]) -> f64 {
    xyz.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Epochs of one station.
pub type Epochs<'a> = Box<dyn Iterator<Item = Result<OwnedEpoch, ReadError>> + 'a>;

impl OpenFiles {
    /// The inputs for an engine, in order of time.
    pub fn stream(&mut self) -> Merge<Epochs<'_>, Epochs<'_>> {
        let ionospheres =
            Constellation::ALL.iter().zip(&self.navigation.klobuchar).filter_map(|(constellation, broadcast)| {
                let klobuchar = broadcast.as_ref().map(|k| Klobuchar { alpha: k.alpha, beta: k.beta })?;
                Some(Ionosphere { constellation: *constellation, klobuchar })
            });
        let ephemerides = self.navigation.ephemerides.iter().copied();
        Merge::new(self.header, ionospheres, ephemerides, epochs(&mut self.rover), epochs(&mut self.base))
    }

    /// One line a file: what was read and what was dropped.
    pub fn reports(&self) -> Vec<String> {
        let observations = [self.rover.report(), self.base.report()];
        observations.into_iter().chain(&self.navigation.reports).map(ToString::to_string).collect()
    }
}

fn epochs(reader: &mut ObservationReader) -> Epochs<'_> {
    Box::new(std::iter::from_fn(|| {
        let epoch = reader.next_epoch().transpose()?;
        Some(epoch.map(|epoch| OwnedEpoch { time: epoch.time, observations: epoch.observations }))
    }))
}
