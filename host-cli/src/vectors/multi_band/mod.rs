//! The multi-band models of Greiff (2023): their geometry, their rows, and moments of a partially linear function.

use super::inputs::{CaseError, Inputs};
use super::{Report, Source};
use nalgebra::Vector3;
use surefix_core::model::multi_band::{Bands, ClockRows, Satellite, Variances};

pub mod adaptation;
pub mod geometry;
pub mod measurement;
pub mod moments;
pub mod smoothing;

/// What the files say of a model, for all its epochs.
pub struct Setting {
    /// The base station; none in single differences.
    pub base: Option<Vector3<f64>>,
    /// Frequencies.
    pub bands: Bands,
    /// Noise of the measurements.
    pub variances: Variances,
    /// Which clocks are measured.
    pub clock_rows: ClockRows,
    /// Satellites of each epoch.
    pub satellites: Vec<Vec<Satellite>>,
}

impl Setting {
    /// Reads it; `double` says whether differences are double.
    pub fn read(root: &Inputs, double: bool) -> Result<Self, CaseError> {
        let sigma = root.object("sigma")?;
        let square = |key: &str| sigma.number(key).map(|sigma| sigma * sigma);
        let variances = Variances {
            code: square("code")?,
            phase: square("phase")?,
            doppler: square("doppler")?,
            ionosphere: square("I")?,
            troposphere: square("T")?,
            clock: if double { Variances::default().clock } else { square("dt")? },
        };
        let absurd = || CaseError::Absurd("frequencies that are not positive and different".to_owned());
        let positions = vectors(root, "sat_pos")?;
        let velocities = vectors(root, "sat_vel")?;
        let satellites = positions.iter().zip(&velocities).map(|(p, v)| join(p, v)).collect();
        Ok(Self {
            base: double.then(|| root.numbers("base").map(Vector3::from)).transpose()?,
            bands: Bands::new(root.numbers("f_hz")?).ok_or_else(absurd)?,
            variances,
            clock_rows: if root.text("clock_meas") == Ok("first") { ClockRows::First } else { ClockRows::All },
            satellites,
        })
    }
}

/// For each epoch a list of vectors.
fn vectors(root: &Inputs, key: &str) -> Result<Vec<Vec<Vector3<f64>>>, CaseError> {
    let wanted = || CaseError::Input { key: key.to_owned(), wanted: "a list of lists of vectors" };
    let epochs = root.0.get(key).and_then(|v| v.as_array()).ok_or_else(wanted)?;
    let vector = |v: &serde_json::Value| Inputs(v).vector();
    epochs.iter().map(|epoch| epoch.as_array()?.iter().map(vector).collect()).collect::<Option<_>>().ok_or_else(wanted)
}

fn join(positions: &[Vector3<f64>], velocities: &[Vector3<f64>]) -> Vec<Satellite> {
    positions.iter().zip(velocities).map(|(&position, &velocity)| Satellite { position, velocity }).collect()
}

/// Notes a part that could not be run.
fn note(part: &str, outcome: Result<(), CaseError>, report: &mut Report) {
    if let Err(error) = outcome {
        report.unreadable(part, error);
    }
}

impl Inputs<'_> {
    /// This value as three numbers.
    fn vector(&self) -> Option<Vector3<f64>> {
        let [x, y, z] = self.0.as_array()?.as_slice() else { return None };
        Some(Vector3::new(x.as_f64()?, y.as_f64()?, z.as_f64()?))
    }
}

/// The whole file as named inputs.
fn root(source: &Source) -> Inputs<'_> {
    Inputs(&source.root)
}
