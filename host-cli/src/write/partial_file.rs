//! A file that gets its name when it is complete.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Writes to `PATH.partial`, buffered. [`PartialFile::keep`] gives it its name; without that it is removed, so that an
/// error leaves no half file, and a file that is read and given as output by mistake survives.
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
        Ok(Self { output: BufWriter::new(File::create(&partial)?), partial, path: path.to_owned() })
    }

    /// The file is complete: it gets its name, in the place of a file that had it before.
    pub fn keep(mut self) -> io::Result<()> {
        self.output.flush()?;
        fs::rename(&self.partial, &self.path)
    }
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
        // Under this name it is there only if it was not kept.
        let _ = fs::remove_file(&self.partial);
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
}
