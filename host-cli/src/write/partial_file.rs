//! A file that gets its name when it is complete.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// All files that are being written, by the names that they have until then.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn unfinished() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Writes to `PATH.partial`, buffered. [`PartialFile::keep`] gives it its name; without that it is removed, so that
/// neither an error nor [an interruption](PartialFile::end_process) leaves a half file, and a file that is read and given
/// as output by mistake survives.
#[derive(Debug)]
pub struct PartialFile {
    output: BufWriter<File>,
    partial: PathBuf,
    path: PathBuf,
}

impl PartialFile {
    /// Starts a file that will be called `path`.
    pub fn create(path: &Path) -> io::Result<Self> {
        let mut partial = path.to_owned().into_os_string();
        partial.push(".partial");
        let partial = PathBuf::from(partial);
        let mut unfinished = unfinished();
        let output = BufWriter::new(File::create(&partial)?);
        unfinished.insert(partial.clone());
        Ok(Self { output, partial, path: path.to_owned() })
    }

    /// What the file will be called.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The file is complete: it gets its name, in the place of a file that had it before.
    pub fn keep(self) -> io::Result<()> {
        Self::keep_all([self])
    }

    /// Files that belong together are complete: an interruption leaves all of them or none.
    pub fn keep_all<const N: usize>(mut files: [Self; N]) -> io::Result<()> {
        files.iter_mut().try_for_each(|file| file.output.flush())?;
        let mut unfinished = unfinished();
        let renamed = files.iter().try_for_each(|file| {
            fs::rename(&file.partial, &file.path)?;
            unfinished.remove(&file.partial);
            Ok(())
        });
        drop(unfinished); // dropping the files needs it
        renamed
    }

    /// Ends the process with an exit code and leaves no unfinished file behind, whatever other threads are writing.
    pub fn end_process(code: i32) -> ! {
        let unfinished = unfinished(); // kept to the end: no file starts or gets its name any more
        unfinished.iter().for_each(remove);
        std::process::exit(code)
    }
}

/// Removes an unfinished file. Where that fails there is nothing to be done about it.
fn remove(partial: &PathBuf) {
    let _ = fs::remove_file(partial);
}

impl Write for PartialFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.output.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.output.flush()
    }
}

impl Drop for PartialFile {
    fn drop(&mut self) {
        // It is in the list only if it was not kept.
        if unfinished().remove(&self.partial) {
            remove(&self.partial);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_complete_file_takes_the_place_of_the_old_one() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.sfl");
        for (text, keep, expected) in [("old", true, "old"), ("half", false, "old"), ("new", true, "new")] {
            let mut file = PartialFile::create(&path).unwrap();
            file.write_all(text.as_bytes()).unwrap();
            if keep {
                file.keep().unwrap();
            } else {
                drop(file);
            }
            assert_eq!(fs::read_to_string(&path).unwrap(), expected);
            assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
        }
    }

    #[test]
    fn files_that_belong_together_get_their_names_together() {
        let directory = tempfile::tempdir().unwrap();
        let paths = ["a", "b"].map(|name| directory.path().join(name));
        let files = paths.clone().map(|path| PartialFile::create(&path).unwrap());
        assert!(paths.iter().all(|path| !path.exists()));
        PartialFile::keep_all(files).unwrap();
        assert!(paths.iter().all(|path| path.exists()));
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 2);
    }
}
