//! What a run leaves behind beside its solutions: tables as CSV, drawings as SVG and PNG, all of it written at the end.

use super::partial_file::PartialFile;
use crate::plot::Drawing;
use crate::plot::png::{self, PngError};
use crate::plot::svg;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Why the files were not written.
#[derive(Debug, thiserror::Error)]
pub enum FilesError {
    /// A file or the directory.
    #[error("{}: cannot be written ({error}); check that the directory may be written to and the disk is not full", path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
    /// A drawing.
    #[error(transparent)]
    Png(#[from] PngError),
}

/// Files by name and content, still in memory.
#[derive(Debug, Default)]
pub struct Files(Vec<(String, Vec<u8>)>);

impl Files {
    /// Adds a file.
    pub fn push(&mut self, name: impl Into<String>, content: Vec<u8>) {
        self.0.push((name.into(), content));
    }

    /// Adds a drawing, as `NAME.svg` and `NAME.png`.
    pub fn draw(&mut self, name: &str, drawing: &Drawing) -> Result<(), FilesError> {
        self.push(format!("{name}.svg"), svg::render(drawing).into_bytes());
        self.push(format!("{name}.png"), png::render(drawing)?);
        Ok(())
    }

    /// Writes them into a directory, which is made if need be, and returns where they are.
    pub fn write(self, directory: &Path) -> Result<Vec<PathBuf>, FilesError> {
        let at = |path: &Path, error| FilesError::Io { path: path.to_owned(), error };
        std::fs::create_dir_all(directory).map_err(|error| at(directory, error))?;
        let write = |(name, content): (String, Vec<u8>)| {
            let path = directory.join(name);
            let file = PartialFile::create(&path);
            file.and_then(|mut file| file.write_all(&content).and_then(|()| file.keep()))
                .map_err(|error| at(&path, error))?;
            Ok(path)
        };
        self.0.into_iter().map(write).collect()
    }
}

/// A table of texts and numbers.
#[derive(Debug)]
pub struct Csv(csv::Writer<Vec<u8>>);

impl Csv {
    /// A table with a header.
    pub fn new(header: impl IntoIterator<Item = impl AsRef<[u8]>>) -> io::Result<Self> {
        let mut table = Self(csv::Writer::from_writer(Vec::new()));
        table.0.write_record(header)?;
        Ok(table)
    }

    /// A row; what is not a number is left empty.
    pub fn row(&mut self, texts: &[&str], numbers: impl IntoIterator<Item = f64>) -> io::Result<()> {
        let numbers = numbers.into_iter().map(|n| if n.is_nan() { String::new() } else { n.to_string() });
        self.0.write_record(texts.iter().map(|text| (*text).to_owned()).chain(numbers))?;
        Ok(())
    }

    /// The content of the file.
    pub fn finish(self) -> io::Result<Vec<u8>> {
        self.0.into_inner().map_err(|error| error.into_error())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_written_into_a_new_directory_or_named_in_the_error() {
        let directory = tempfile::tempdir().unwrap();
        let mut csv = Csv::new(["name", "a", "b"]).unwrap();
        csv.row(&["one, two"], [0.1, f64::NAN]).unwrap();
        let mut files = Files::default();
        files.push("table.csv", csv.finish().unwrap());
        let written = files.write(&directory.path().join("new")).unwrap();
        assert_eq!(std::fs::read_to_string(&written[0]).unwrap(), "name,a,b\n\"one, two\",0.1,\n");
        let error = Files::default().write(&written[0].join("below")).unwrap_err().to_string();
        assert!(error.contains("table.csv") && error.contains("cannot be written"), "{error}");
    }
}
