//! Data files that cases refer to by name.

use super::inputs::CaseError;
use crate::read::ReadError;
use crate::read::antex::Antex;
use crate::read::clock::Clocks;
use crate::read::gpt3::Gpt3File;
use crate::read::ionex::Ionex;
use crate::read::rinex::{NavigationData, ObservationEpoch, ObservationReader};
use crate::read::sp3::Sp3;
use std::cell::RefCell;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use surefix_core::gnss::time::GpsTime;

/// A directory with data files, each read once.
#[derive(Default)]
pub struct DataFiles {
    directory: Option<PathBuf>,
    navigation: Read<NavigationData>,
    ionex: Read<Ionex>,
    gpt3: Read<Gpt3File>,
    sp3: Read<Sp3>,
    clocks: Read<Clocks>,
    antex: Read<Antex>,
}

/// What was read of files, by name.
type Read<T> = RefCell<HashMap<String, Rc<T>>>;

impl DataFiles {
    /// Files below `directory`, if there is one.
    pub fn new(directory: Option<&Path>) -> Self {
        Self { directory: directory.map(Path::to_owned), ..Self::default() }
    }

    /// What a navigation file says. Names are as [`find`] takes them.
    pub fn navigation(&self, name: &str) -> Result<Rc<NavigationData>, CaseError> {
        self.once(&self.navigation, name, NavigationData::open)
    }

    /// The maps of an IONEX file. Names are as [`find`] takes them.
    pub fn ionex(&self, name: &str) -> Result<Rc<Ionex>, CaseError> {
        self.once(&self.ionex, name, |path| Ok(Ionex::open(path)?.0))
    }

    /// A grid of GPT3. Names are as [`find`] takes them.
    pub fn gpt3(&self, name: &str) -> Result<Rc<Gpt3File>, CaseError> {
        self.once(&self.gpt3, name, |path| Ok(Gpt3File::open(path)?.0))
    }

    /// Precise orbits and clocks of an SP3 file. Names are as [`find`] takes them.
    pub fn sp3(&self, name: &str) -> Result<Rc<Sp3>, CaseError> {
        self.once(&self.sp3, name, Sp3::open)
    }

    /// Satellite clocks of a clock file. Names are as [`find`] takes them.
    pub fn clocks(&self, name: &str) -> Result<Rc<Clocks>, CaseError> {
        self.once(&self.clocks, name, Clocks::open)
    }

    /// An antenna file. Names are as [`find`] takes them.
    pub fn antex(&self, name: &str) -> Result<Rc<Antex>, CaseError> {
        self.once(&self.antex, name, Antex::open)
    }

    /// What was read of a file, read now if it was not.
    fn once<T>(
        &self,
        known: &Read<T>,
        name: &str,
        open: impl Fn(&Path) -> Result<T, ReadError>,
    ) -> Result<Rc<T>, CaseError> {
        if let Some(data) = known.borrow().get(name) {
            return Ok(Rc::clone(data));
        }
        let path = self.path(name)?;
        let data = Rc::new(open(&path).map_err(|error| CaseError::Absurd(error.to_string()))?);
        known.borrow_mut().insert(name.to_owned(), Rc::clone(&data));
        Ok(data)
    }

    /// The epoch of an observation file at `time`. Names are as [`find`] takes them.
    pub fn epoch(&self, name: &str, time: GpsTime) -> Result<ObservationEpoch, CaseError> {
        let unusable = |error: ReadError| CaseError::Absurd(error.to_string());
        let mut reader = ObservationReader::open(&self.path(name)?).map_err(unusable)?;
        while let Some(epoch) = reader.next_epoch().map_err(unusable)? {
            if epoch.time.since(time).abs() < SAME_EPOCH {
                return Ok(epoch);
            }
        }
        Err(CaseError::Absent { file: format!("{name}, epoch {time}") })
    }

    fn path(&self, name: &str) -> Result<PathBuf, CaseError> {
        let absent = || CaseError::Absent { file: name.to_owned() };
        self.directory.as_deref().and_then(|directory| find(directory, name)).ok_or_else(absent)
    }
}

/// Epochs of a case, which are full seconds, and of its file differ by less `[s]`.
const SAME_EPOCH: f64 = 0.05;

/// A file below `directory`, plain or gzipped: one of this very name, or, for a name `DIR FILE`, that file in a directory
/// of that name, or else the only one there with its extension or the rover's.
fn find(directory: &Path, name: &str) -> Option<PathBuf> {
    let is_named = |path: &Path, wanted: &str| plain_name(path).is_some_and(|plain| plain == wanted);
    if let Some(path) = files_below(directory).into_iter().find(|path| is_named(path, name)) {
        return Some(path);
    }
    let (place, file) = name.split_once(' ')?;
    let extension = Path::new(file).extension()?.to_str()?;
    let ends_so = |path: &PathBuf| plain_name(path).is_some_and(|plain| plain.ends_with(&format!(".{extension}")));
    let files: Vec<PathBuf> = files_below(&directory.join(place)).into_iter().filter(ends_so).collect();
    let of_rover = format!("rover.{extension}");
    let named = |wanted: &str| files.iter().find(|path| is_named(path, wanted));
    let only = || files.first().filter(|_| files.len() == 1);
    named(file).or_else(only).or_else(|| named(&of_rover)).cloned()
}

/// The name of a file without directory and `.gz`.
fn plain_name(path: &Path) -> Option<String> {
    let name = path.file_name()?.to_str()?;
    Some(name.strip_suffix(".gz").unwrap_or(name).to_owned())
}

/// Files in a directory and the directories in it, in order of their paths.
fn files_below(directory: &Path) -> Vec<PathBuf> {
    let entries = |directory: &Path| -> Vec<PathBuf> {
        let Ok(entries) = std::fs::read_dir(directory) else { return Vec::new() };
        entries.filter_map(|entry| Some(entry.ok()?.path())).collect()
    };
    let mut files = entries(directory);
    let deeper: Vec<PathBuf> = files.iter().filter(|path| path.is_dir()).flat_map(|path| entries(path)).collect();
    files.extend(deeper);
    files.retain(|path| path.is_file());
    files.sort();
    files
}
