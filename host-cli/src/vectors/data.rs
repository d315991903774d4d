//! Observation and navigation files that cases refer to by name.

use super::inputs::CaseError;
use crate::read::rinex::NavigationData;
use std::cell::RefCell;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// A directory with data files, each read once.
#[derive(Default)]
pub struct DataFiles {
    directory: Option<PathBuf>,
    navigation: RefCell<HashMap<String, Rc<NavigationData>>>,
}

impl DataFiles {
    /// Files below `directory`, if there is one.
    pub fn new(directory: Option<&Path>) -> Self {
        Self { directory: directory.map(Path::to_owned), ..Self::default() }
    }

    /// What a navigation file says. Names are as [`find`] takes them.
    pub fn navigation(&self, name: &str) -> Result<Rc<NavigationData>, CaseError> {
        if let Some(data) = self.navigation.borrow().get(name) {
            return Ok(Rc::clone(data));
        }
        let absent = || CaseError::Absent { file: name.to_owned() };
        let path = self.directory.as_deref().and_then(|directory| find(directory, name)).ok_or_else(absent)?;
        let data = NavigationData::open(&path).map_err(|error| CaseError::Absurd(error.to_string()))?;
        let data = Rc::new(data);
        self.navigation.borrow_mut().insert(name.to_owned(), Rc::clone(&data));
        Ok(data)
    }
}

/// A file below `directory`, plain or gzipped: either of this very name, or, for a name of two words, the only file with
/// the second word's extension in the directory named by the first.
fn find(directory: &Path, name: &str) -> Option<PathBuf> {
    let is_named = |path: &PathBuf| plain_name(path).is_some_and(|plain| plain == name);
    if let Some(path) = files_below(directory).into_iter().find(is_named) {
        return Some(path);
    }
    let (place, file) = name.split_once(' ')?;
    let extension = Path::new(file).extension()?;
    let is_of_kind = |path: &PathBuf| plain_name(path).is_some_and(|n| Path::new(&n).extension() == Some(extension));
    let mut candidates = files_below(&directory.join(place)).into_iter().filter(is_of_kind);
    candidates.next().filter(|_| candidates.next().is_none())
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
