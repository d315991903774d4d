//! Which file is what, and what is missing.
//!
//! Files are told apart by their content, so that their order does not matter. What a run does without is said in a warning that
//! names what it costs; products that cannot belong to the observations are errors.

use super::products::HostProducts;
use crate::process::stream::Span;
use crate::read::antex::Antex;
use crate::read::bias::BiasData;
use crate::read::blq::Blq;
use crate::read::clock::Clocks;
use crate::read::erp::EarthOrientationSeries;
use crate::read::kind;
use crate::read::rinex::{NavigationData, ObservationHeader, ObservationReader};
use crate::read::sp3::Sp3;
use crate::read::{FileKind, ReadError, ReadReport};
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use surefix_core::gnss::ephemeris::Ephemeris;
use surefix_core::gnss::satellite::Constellation;
use surefix_core::gnss::time::GpsTime;
use surefix_core::ppp::select::BandPairs;
use thiserror::Error;

/// Distances from the geocentre at which a receiver can be `[m]`.
const RADII: std::ops::RangeInclusive<f64> = 6.2e6..=6.5e6;

/// A station of the ocean loading file within this is the same place `[m]`.
const NEAR: f64 = 10_000.0;

/// The files of a run.
#[derive(Clone, Debug, Default)]
pub struct FileList {
    /// Observations, in the order given.
    pub observations: Vec<PathBuf>,
    /// Navigation messages.
    pub navigation: Vec<PathBuf>,
    /// Orbits.
    pub orbits: Vec<PathBuf>,
    /// Clocks.
    pub clocks: Vec<PathBuf>,
    /// Antennas.
    pub antennas: Vec<PathBuf>,
    /// Code biases.
    pub biases: Vec<PathBuf>,
    /// Ocean loading.
    pub ocean: Vec<PathBuf>,
    /// Orientation of the Earth.
    pub orientation: Vec<PathBuf>,
}

/// Why files cannot be used together.
#[derive(Debug, Error)]
pub enum FilesError {
    /// A file cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// It is not known what a file is.
    #[error(
        "{0}: neither observations, navigation messages, SP3 orbits, clocks, antennas nor any other product that is read here; leave it out, or name what it is (--antex, --bias, --blq, --erp)"
    )]
    Unknown(String),
    /// There are no observations.
    #[error(
        "none of the files has observations (RINEX 2 or 3, plain, gzipped or compact); give the one of the receiver"
    )]
    NoObservations,
    /// There are no orbits.
    #[error(
        "none of the files has orbits; give the SP3 file of the day, or at least navigation messages, with which positions are good to a metre"
    )]
    NoOrbits,
    /// Products of another day.
    #[error("{what} ({product}) do not overlap with the observations ({observations}); give the products of that day")]
    OtherDay {
        /// Which products.
        what: &'static str,
        /// Their time.
        product: Span,
        /// That of the observations.
        observations: Span,
    },
}

impl FileList {
    /// Sorts files by their content.
    pub fn sort(files: &[PathBuf]) -> Result<Self, FilesError> {
        let mut list = Self::default();
        for path in files {
            match kind(path)? {
                Some(kind) => list.push(kind, path.clone())?,
                None => return Err(FilesError::Unknown(path.display().to_string())),
            }
        }
        Ok(list)
    }

    /// Adds a file of a known kind.
    pub fn push(&mut self, kind: FileKind, path: PathBuf) -> Result<(), FilesError> {
        match kind {
            FileKind::Observation => self.observations.push(path),
            FileKind::Navigation => self.navigation.push(path),
            FileKind::PreciseOrbit => self.orbits.push(path),
            FileKind::Clock => self.clocks.push(path),
            FileKind::Antenna => self.antennas.push(path),
            FileKind::Bias => self.biases.push(path),
            FileKind::OceanLoading => self.ocean.push(path),
            FileKind::EarthOrientation => self.orientation.push(path),
            _ => return Err(FilesError::Unknown(path.display().to_string())),
        }
        Ok(())
    }

    /// All of them.
    pub fn all(&self) -> impl Iterator<Item = &PathBuf> {
        [
            &self.observations,
            &self.navigation,
            &self.orbits,
            &self.clocks,
            &self.antennas,
            &self.biases,
            &self.ocean,
            &self.orientation,
        ]
        .into_iter()
        .flatten()
    }
}

/// Files that were opened.
pub struct Opened {
    /// Observations, in the order given; headers are read.
    pub observations: Vec<ObservationReader>,
    /// Everything else.
    pub products: HostProducts,
    /// Where the marker is by the header, if that makes sense.
    pub approximate: Option<Vector3<f64>>,
    /// Antenna reference point from the marker: east, north, up `[m]`.
    pub antenna: Vector3<f64>,
    /// GLONASS channels by slot.
    pub channels: BTreeMap<u8, i8>,
    /// What is missing or doubtful, and what that costs.
    pub warnings: Vec<String>,
    /// What was read and what was dropped.
    pub reports: Vec<ReadReport>,
}

/// Reads all of several files of a kind into one.
fn read_all<T>(
    paths: &[PathBuf],
    open: impl Fn(&Path) -> Result<T, ReadError>,
    merge: impl Fn(&mut T, T),
) -> Result<Option<T>, ReadError> {
    let mut all = None::<T>;
    for path in paths {
        let next = open(path)?;
        match &mut all {
            Some(all) => merge(all, next),
            None => all = Some(next),
        }
    }
    Ok(all)
}

impl Opened {
    /// Opens the files of a run.
    pub fn new(list: &FileList) -> Result<Self, FilesError> {
        if list.observations.is_empty() {
            return Err(FilesError::NoObservations);
        }
        if list.orbits.is_empty() && list.navigation.is_empty() {
            return Err(FilesError::NoOrbits);
        }
        let observations =
            list.observations.iter().map(|path| ObservationReader::open(path)).collect::<Result<Vec<_>, _>>()?;
        let mut opened = Self {
            observations,
            products: HostProducts::default(),
            approximate: None,
            antenna: Vector3::zeros(),
            channels: BTreeMap::new(),
            warnings: Vec::new(),
            reports: Vec::new(),
        };
        opened.read_station();
        opened.read_products(list)?;
        opened.read_antennas(list)?;
        opened.read_rest(list)?;
        opened.products.learn_clocks();
        Ok(opened)
    }

    fn warn(&mut self, warning: impl Into<String>) {
        self.warnings.push(warning.into());
    }

    /// What the header says of the station.
    fn read_station(&mut self) {
        let Some(header) = self.observations.first().map(ObservationReader::header) else { return };
        let [up, east, north] = header.antenna_delta_hen;
        self.antenna = Vector3::new(east, north, up);
        self.channels.extend(header.glonass_channels.iter().map(|(&slot, &channel)| (slot, channel)));
        let approximate = header.approximate_position.map(Vector3::from);
        self.approximate = approximate.filter(|position| RADII.contains(&position.norm()));
        let [file, marker] = [self.observations[0].report().file.clone(), header.marker.clone()];
        match (approximate, self.approximate) {
            (Some(position), None) => {
                let [x, y, z] = position.into();
                self.warn(format!(
                    "{file}: the approximate position {x} {y} {z} of its header is not on the Earth; it is not used: the start \
                     comes from the codes"
                ));
            }
            (None, _) => self.warn(format!(
                "{file}: its header has no approximate position, or zeros: the start comes from the codes, and ocean loading \
                 can only be found by the marker's name"
            )),
            _ => {}
        }
        for other in &self.observations[1..] {
            if other.header().marker != marker {
                let warning = format!(
                    "{}: marker {} where {file} has {marker}; they are processed as one receiver",
                    other.report().file,
                    other.header().marker,
                );
                self.warnings.push(warning);
                break;
            }
        }
    }

    /// Orbits, clocks, navigation messages.
    fn read_products(&mut self, list: &FileList) -> Result<(), FilesError> {
        let navigation = read_all(&list.navigation, NavigationData::open, NavigationData::merge)?.unwrap_or_default();
        let mut ephemerides = navigation.ephemerides;
        ephemerides.sort_by_key(|ephemeris| (ephemeris.satellite(), ephemeris.toe()));
        for ephemeris in &ephemerides {
            if let Ephemeris::Glonass(glonass) = ephemeris {
                self.channels.entry(glonass.satellite.number()).or_insert(glonass.channel);
            }
        }
        self.products.broadcast = ephemerides;
        self.reports.extend(navigation.reports);
        self.products.orbits = read_all(&list.orbits, Sp3::open, Sp3::merge)?;
        self.products.clocks = read_all(&list.clocks, Clocks::open, Clocks::merge)?;
        let mut warnings = Vec::new();
        match (&self.products.orbits, &self.products.clocks) {
            (None, _) => warnings.push(
                "no SP3 file: orbits and clocks are those that satellites broadcast; positions are good to a metre, not \
                 to centimetres"
                    .into(),
            ),
            (Some(orbits), None) => {
                let spacing = orbits.spacing().unwrap_or(f64::NAN);
                warnings.push(format!(
                    "no clock file: clocks are those of the SP3 file, every {spacing:.0} s; in between they are off by a \
                     centimetre or more, which is in the noise of the measurements (give the CLK file of 30 s)"
                ));
            }
            _ => {}
        }
        if let Some(orbits) = &self.products.orbits {
            self.reports.extend(orbits.reports.iter().cloned());
            let frames: Vec<&str> = orbits.headers.iter().map(|header| header.frame.as_str()).collect();
            if frames.iter().any(|frame| *frame != frames[0]) {
                warnings
                    .push(format!("SP3 files in different frames: {}; positions jump between them", frames.join(", ")));
            }
        }
        if let Some(clocks) = &self.products.clocks {
            self.reports.extend(clocks.reports.iter().cloned());
            if let Some(orbits) = &self.products.orbits {
                let without: Vec<String> = orbits
                    .satellites()
                    .filter(|&satellite| clocks.clock(satellite).is_empty())
                    .map(|satellite| satellite.to_string())
                    .collect();
                if !without.is_empty() {
                    let with_sp3 =
                        orbits.satellites().filter(|&s| clocks.clock(s).is_empty() && !orbits.clock(s).is_empty());
                    warnings.push(format!(
                        "not in the clock files: {}; {} of them have clocks in the SP3 file, the others are left out",
                        without.join(" "),
                        with_sp3.count(),
                    ));
                }
            }
        }
        self.warnings.extend(warnings);
        Ok(())
    }

    /// Antennas, and whether they are of the frame of the orbits.
    fn read_antennas(&mut self, list: &FileList) -> Result<(), FilesError> {
        let antennas = list.antennas.iter().map(|path| Antex::open(path)).collect::<Result<Vec<_>, _>>()?;
        self.reports.extend(antennas.iter().map(|antennas| antennas.report.clone()));
        let name = self.observations[0].header().antenna.clone();
        if antennas.is_empty() {
            if self.products.is_precise() {
                self.warn(
                    "no ANTEX file: phase centres of satellites (up to 3 m from their centres of mass) and of the receiver \
                     (10 cm) are not known; heights are off by 5 to 20 cm (give it by --antex)",
                );
            }
            return Ok(());
        }
        let file = list.antennas.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ");
        match antennas.iter().find_map(|antennas| antennas.receiver(&name)) {
            Some(found) => {
                if !found.radome_known {
                    let warning = format!(
                        "{file}: antenna {name} is not there with its radome; that without radome is used, heights may be off \
                         by a centimetre"
                    );
                    self.warnings.push(warning);
                }
                let mut antenna = found.antenna.clone();
                let added: Vec<String> = antenna.complete().iter().map(ToString::to_string).collect();
                self.products.receiver = Some(antenna);
                if !added.is_empty() {
                    let warning = format!(
                        "{file}: antenna {} has no calibration for {}: those of GPS L1 and L2 are carried on in the wavelength",
                        name.trim(),
                        added.join(" ")
                    );
                    self.warnings.push(warning);
                }
            }
            None => self.warn(format!(
                "{file}: antenna \"{}\" of the observations is not there; its phase centre is not known, heights are off \
                 by about 10 cm",
                name.trim()
            )),
        }
        let frame =
            self.products.orbits.as_ref().and_then(|orbits| orbits.headers.first()).map(|header| header.frame.clone());
        let model = antennas.iter().find_map(|antennas| antennas.model.clone());
        if let (Some(frame), Some(model)) = (frame, model)
            && let (Some(a), Some(b)) = (generation(&frame), generation(&model))
            && a != b
        {
            self.warn(format!(
                "{file}: antennas of the model {model}, orbits in the frame {frame}: they do not belong together, heights \
                 are off by a centimetre or two (give igs{a:02}.atx)"
            ));
        }
        self.products.antennas = antennas;
        Ok(())
    }

    /// Biases, ocean loading, orientation of the Earth.
    fn read_rest(&mut self, list: &FileList) -> Result<(), FilesError> {
        for path in &list.biases {
            let report = match &mut self.products.biases {
                Some(biases) => biases.add(path)?,
                None => {
                    let (biases, report) = BiasData::open(path)?;
                    self.products.biases = Some(biases);
                    report
                }
            };
            self.reports.push(report);
        }
        if self.products.biases.is_none() && self.products.is_precise() {
            self.warn(
                "no file of code biases: codes of other signals than those of the clocks are off by decimetres, which \
                 slows the start (give it by --bias)",
            );
        }
        if let Some(path) = list.orientation.first() {
            let (orientation, report) = EarthOrientationSeries::open(path)?;
            self.products.orientation = Some(orientation);
            self.reports.push(report);
        } else if self.products.is_precise() {
            self.warn("no orientation of the Earth: the pole tide (up to 2.5 cm) is left out (give it by --erp)");
        }
        match list.ocean.first() {
            Some(path) => {
                let (blq, report) = Blq::open(path)?;
                self.reports.push(report);
                let marker = self.observations[0].header().marker.clone();
                let station = marker.trim().get(..4).unwrap_or(marker.trim());
                let by_place = || blq.nearest(self.approximate.as_ref()?, NEAR).ok().map(|(station, _)| station);
                let loading = blq.find(station).ok().or_else(by_place).map(|station| station.loading);
                match loading {
                    Some(loading) => self.products.ocean = Some(loading),
                    None => self.warn(format!(
                        "{}: has neither station {station} nor one within {NEAR:.0} m; ocean loading (up to some centimetres near \
                         coasts) is left out",
                        path.display()
                    )),
                }
            }
            None if self.products.is_precise() => {
                self.warn(
                    "no file of ocean loading: it is left out, up to some centimetres near coasts (give it by --blq)",
                );
            }
            None => {}
        }
        Ok(())
    }

    /// Warns if no constellation of the observations has both bands of the plan.
    pub fn check_bands(&mut self, plan: &BandPairs) {
        let has_pair = |header: &ObservationHeader, constellation: Constellation| {
            let has = |band: u8| header.signals(constellation).iter().any(|signal| signal.band() == band);
            // As the engine takes B2I where there is no B3I.
            let second = |band: u8| has(band) || (constellation == Constellation::BeiDou && has(b'7'));
            plan.of(constellation).is_some_and(|[a, b]| has(a) && second(b))
        };
        let headers = self.observations.iter().map(ObservationReader::header);
        if headers.into_iter().all(|header| Constellation::ALL.into_iter().all(|c| !has_pair(header, c))) {
            let file = self.observations.first().map_or(String::new(), |reader| reader.report().file.clone());
            self.warn(format!(
                "{file}: no constellation has two bands of those wanted, so that the ionosphere cannot be told from the range and \
                 there will be no position; name the bands that it has (--bands), or process it with a base (surefix post)"
            ));
        }
    }

    /// Whether the products are of the time of the observations, once that is known.
    pub fn check_time(&mut self, observed: [GpsTime; 2]) -> Result<(), FilesError> {
        let observations = Span { first: observed[0], last: observed[1] };
        let check = |what, span: Option<(GpsTime, GpsTime)>| match span {
            Some((first, last)) if last < observations.first || first > observations.last => {
                Err(FilesError::OtherDay { what, product: Span { first, last }, observations })
            }
            _ => Ok(()),
        };
        check("orbits", self.products.orbits.as_ref().and_then(Sp3::span))?;
        check("clocks", self.products.clocks.as_ref().and_then(Clocks::span))?;
        if self.products.orbits.is_none() {
            let times = self.products.broadcast.iter().map(Ephemeris::toe);
            check("navigation messages", times.clone().min().zip(times.max()))?;
        }
        if let Some(biases) = &self.products.biases
            && let Some(of) = biases.span()
            && observed.iter().all(|&time| biases.at(time).is_empty())
        {
            let of = Span { first: of.from, last: of.until };
            self.warn(format!(
                "the code biases are of {of}, the observations of {observations}: none is used, which slows the start; give those of \
                 the day"
            ));
        }
        Ok(())
    }
}

/// The generation of a frame or antenna model of the IGS: 14 of IGS14, IGb14 and igs14_2163.
fn generation(name: &str) -> Option<u8> {
    let name = name.trim().to_ascii_lowercase();
    let rest = name.strip_prefix("igb").or_else(|| name.strip_prefix("igs")).or_else(|| name.strip_prefix("igc"))?;
    let digits: String = rest.chars().take_while(char::is_ascii_digit).take(2).collect();
    digits.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_and_antenna_models_have_generations() {
        for (name, expected) in [
            ("IGb14", Some(14)),
            ("IGS14", Some(14)),
            ("IGS14_2163", Some(14)),
            ("IGS20", Some(20)),
            ("igs05_1627", Some(5)),
            ("ITR14", None),
            ("", None),
        ] {
            assert_eq!(generation(name), expected, "{name}");
        }
    }
}
