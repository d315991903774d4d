//! A record of what the PPP engine used, or what a study or a vector file makes up: rows that are linear in the states.
//!
//! ```text
//! value = d·p + clock + isb(group) + m_w zwd + m_g·(g_N, g_E) + m_i I + N(arc) + e,     e ~ N(0, variance)
//! ```
//! p is the position relative to [`Tape::origin`], d = ∂range/∂position the unit vector from the satellite to the receiver
//! (Zhang et al. 2020, eqs. (4), (5), (9)); all lengths in metres, ambiguities too. Where [`Tape::geometry`] is given the
//! rows can be linearised again about another trajectory. A row takes 104 bytes, with its geometry 136: a day at 30 s with
//! 20 satellites of a code and a phase each 16 MB. Nothing here panics if the indices of rows lie within the lists they
//! point into, which [`Tape::check`] tells.

use nalgebra::Vector3;
use std::ops::Range;
use surefix_core::gnss::satellite::{Constellation, SatelliteId};
use surefix_core::gnss::time::GpsTime;
use thiserror::Error;

/// A type of measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Kind {
    /// Code pseudorange.
    Code = 0,
    /// Carrier phase.
    Phase = 1,
}

impl Kind {
    /// In the order of their numbers.
    pub const ALL: [Self; 2] = [Self::Code, Self::Phase];

    /// For people.
    pub const fn name(self) -> &'static str {
        ["code", "phase"][self as usize]
    }
}

/// One measurement of an epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// What it is.
    pub kind: Kind,
    /// Of which satellite.
    pub satellite: SatelliteId,
    /// Index of its constellation and signal (or combination of signals) in [`Tape::groups`].
    pub group: u16,
    /// Index of its arc in [`Tape::arcs`]; of codes nothing.
    pub arc: u32,
    /// Elevation `[rad]`.
    pub elevation: f64,
    /// d, the derivative of the range by the position (ECEF): minus the unit vector to the satellite.
    pub direction: [f64; 3],
    /// m_w, the mapping of the zenith wet delay.
    pub wet: f64,
    /// m_g, those of the gradients to the north and to the east.
    pub gradients: [f64; 2],
    /// m_i, the coefficient of the satellite's slant delay; 0 in combinations free of the ionosphere.
    pub ionosphere: f64,
    /// What is left of the measurement for the states to explain `[m]`.
    pub value: f64,
    /// Its variance by the engine `[m²]`, with which smoothing starts.
    pub variance: f64,
    /// How its variance compares with those of its pool: pools learn a factor on it; 1 if nothing is known.
    pub shape: f64,
}

/// What a row was before it was linearised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry {
    /// Position of the satellite at transmission, in the ECEF frame at reception (turned by the Earth meanwhile) `[m]`.
    pub satellite: Vector3<f64>,
    /// The measurement less all that is modelled but the geometric range `[m]`.
    pub measured: f64,
}

/// A constellation and signal, of code and phase.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// For people: "G L1/L2".
    pub name: String,
    /// The constellation.
    pub constellation: Constellation,
    /// Index of the inter-system bias that its rows have beside the clock; none for the reference.
    pub isb: Option<usize>,
}

/// An ambiguity, the same from birth or slip to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arc {
    /// Of which satellite.
    pub satellite: SatelliteId,
    /// Index of its signal in [`Tape::groups`].
    pub group: u16,
    /// First epoch.
    pub first: usize,
    /// Last epoch.
    pub last: usize,
    /// About what it is, before anything is estimated: phase less code of its first epoch `[m]`.
    pub prior: f64,
}

/// The rows of one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Epoch {
    /// Time of reception.
    pub time: GpsTime,
    /// Its rows in [`Tape::rows`]; an epoch may have none.
    pub rows: Range<usize>,
    /// About what the clock is, to within the prior of the clock `[m]`.
    pub clock: f64,
    /// Position about which its rows are linearised, ECEF `[m]`; also where [`Tape::geometry`] is absent.
    pub position: Vector3<f64>,
}

/// All epochs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tape {
    /// Point that positions are relative to, ECEF `[m]`.
    pub origin: Vector3<f64>,
    /// The epochs, in order of time.
    pub epochs: Vec<Epoch>,
    /// The rows, epoch after epoch.
    pub rows: Vec<Row>,
    /// What the rows were before they were linearised, one for each; or none where the problem is linear.
    pub geometry: Vec<Geometry>,
    /// Constellations and signals.
    pub groups: Vec<Group>,
    /// Ambiguities.
    pub arcs: Vec<Arc>,
}

/// Why a tape cannot be smoothed.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum TapeError {
    /// A row points beyond a list, or into an arc that does not live in its epoch.
    #[error("row {0} of the record points to a group or an arc that is not there")]
    Row(usize),
    /// A number of a row is not finite, or its variance not positive.
    #[error("row {0} of the record has a number that is not finite or a variance that is not positive")]
    Number(usize),
    /// The rows of an epoch are not a part of the list, or its time is not after the one before.
    #[error("epoch {0} of the record is not after the one before, or has rows that are not there")]
    Epoch(usize),
    /// There is not one geometry for each row.
    #[error("the record has satellite positions for some of its rows only")]
    Geometry,
}

impl Tape {
    /// The usual (median) time between epochs `[s]`; `None` of less than two.
    pub fn interval(&self) -> Option<f64> {
        let mut steps: Vec<f64> = self.epochs.windows(2).map(|pair| pair[1].time.since(pair[0].time)).collect();
        steps.sort_by(f64::total_cmp);
        steps.get(steps.len() / 2).copied()
    }

    /// Whether all indices lie within their lists, numbers are finite and variances positive.
    pub fn check(&self) -> Result<(), TapeError> {
        if !self.geometry.is_empty() && self.geometry.len() != self.rows.len() {
            return Err(TapeError::Geometry);
        }
        let mut end = 0;
        for (k, epoch) in self.epochs.iter().enumerate() {
            let after = k == 0 || epoch.time.since(self.epochs[k - 1].time) > 0.0;
            let Range { start, end: next } = epoch.rows.clone();
            if !after || start != end || next < start || next > self.rows.len() || !epoch.clock.is_finite() {
                return Err(TapeError::Epoch(k));
            }
            for i in epoch.rows.clone() {
                self.check_row(i, k)?;
            }
            end = next;
        }
        Ok(())
    }

    fn check_row(&self, i: usize, k: usize) -> Result<(), TapeError> {
        let row = &self.rows[i];
        let arc = || self.arcs.get(row.arc as usize).is_some_and(|arc| (arc.first..=arc.last).contains(&k));
        if usize::from(row.group) >= self.groups.len() || (row.kind == Kind::Phase && !arc()) {
            return Err(TapeError::Row(i));
        }
        let [x, y, z] = row.direction;
        let [north, east] = row.gradients;
        let numbers =
            [row.elevation, x, y, z, row.wet, north, east, row.ionosphere, row.value, row.variance, row.shape];
        let finite = numbers.iter().all(|number| number.is_finite()) && row.variance.min(row.shape) > 0.0;
        if finite { Ok(()) } else { Err(TapeError::Number(i)) }
    }

    /// Number of inter-system biases.
    pub fn biases(&self) -> usize {
        self.groups.iter().filter_map(|group| group.isb).max().map_or(0, |last| last + 1)
    }

    /// Linearises the rows of each epoch about a position (ECEF `[m]`), exactly; does nothing without [`Tape::geometry`].
    /// Positions that are missing or not finite leave their epochs as they are.
    pub fn relinearize(&mut self, positions: &[Vector3<f64>]) {
        if self.geometry.len() != self.rows.len() {
            return;
        }
        let Self { origin, epochs, rows, geometry, .. } = self;
        for (epoch, position) in epochs.iter_mut().zip(positions) {
            if !position.iter().all(|x| x.is_finite()) {
                continue;
            }
            epoch.position = *position;
            let offset = position - *origin;
            for i in epoch.rows.clone() {
                let line = position - geometry[i].satellite;
                let range = line.norm();
                let direction = line / range;
                rows[i].direction = direction.into();
                rows[i].value = geometry[i].measured - range + direction.dot(&offset);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::drawn;
    use super::*;

    /// Satellites at 26 000 km: what is left after linearisation about a point is quadratic in the distance from it, at most
    /// d²/(2 ρ), and zero at the point itself.
    #[test]
    fn relinearised_rows_are_exact_at_the_trajectory() {
        let mut tape = drawn(1).tape;
        let origin = Vector3::new(4e6, 1e6, 4.8e6);
        tape.origin = origin;
        let truth = origin + Vector3::new(30.0, -20.0, 12.0);
        tape.geometry = tape
            .rows
            .iter()
            .map(|row| {
                let satellite = truth - 2.2e7 * Vector3::from(row.direction);
                Geometry { satellite, measured: (truth - satellite).norm() + 7.0 }
            })
            .collect();
        let misfit = |tape: &Tape| {
            let of = |row: &Row| row.value - Vector3::from(row.direction).dot(&(truth - origin)) - 7.0;
            tape.rows.iter().map(of).fold(0.0, |most: f64, x| most.max(x.abs()))
        };
        let positions = vec![truth; tape.epochs.len()];
        tape.relinearize(&positions);
        // (Rounding at 2e7 m.)
        assert!(misfit(&tape) < 2e-8, "{}", misfit(&tape));
        tape.relinearize(&vec![truth + Vector3::new(100.0, 0.0, 0.0); positions.len()]);
        let far = misfit(&tape);
        assert!(far > 1e-6 && far < 1e4 / (2.0 * 2.2e7) * 1.01, "{far}");
        let before = tape.clone();
        tape.relinearize(&vec![Vector3::repeat(f64::NAN); positions.len()]);
        assert_eq!(tape, before);
    }

    #[test]
    fn what_points_beyond_its_list_is_found() {
        let tape = drawn(1).tape;
        assert_eq!(tape.check(), Ok(()));
        let spoilt = |spoil: &dyn Fn(&mut Tape)| {
            let mut tape = tape.clone();
            spoil(&mut tape);
            tape.check()
        };
        assert_eq!(spoilt(&|tape| tape.rows[3].group = 99), Err(TapeError::Row(3)));
        let phase = tape.rows.iter().position(|row| row.kind == Kind::Phase).unwrap();
        assert_eq!(spoilt(&|tape| tape.rows[phase].arc = u32::MAX), Err(TapeError::Row(phase)));
        assert_eq!(spoilt(&|tape| tape.rows[5].value = f64::NAN), Err(TapeError::Number(5)));
        assert_eq!(spoilt(&|tape| tape.rows[5].variance = 0.0), Err(TapeError::Number(5)));
        assert_eq!(spoilt(&|tape| tape.epochs[2].time = tape.epochs[1].time), Err(TapeError::Epoch(2)));
        assert_eq!(spoilt(&|tape| tape.epochs[0].rows.end += 1), Err(TapeError::Epoch(1)));
        let geometry = Geometry { satellite: Vector3::zeros(), measured: 0.0 };
        assert_eq!(spoilt(&|tape| tape.geometry.push(geometry)), Err(TapeError::Geometry));
    }
}
