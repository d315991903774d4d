//! Geometry G2: satellites on great circles about a fixed point, by the numbers of the file and by those of the study; and
//! the root of the positional covariance (S-RAPC) that the models of Appendix A have in it at k = K/2 once all integers are
//! known. It depends on geometry and noise alone, so that any measurements will do.

use super::super::integer::compare;
use super::{CaseError, Inputs, Report, Source, note, root, vectors};
use crate::smooth::model::{Density, Model};
use crate::smooth::multi_band::{MultiBand, Record, Settings};
use crate::smooth::pass::{PassOptions, Passes};
use crate::study::smoothing::geometry::{Circle, Geometry};
use nalgebra::Vector3;
use serde_json::Value;
use surefix_core::model::multi_band::{BANDS, Bands};
use surefix_core::model::partially_linear::Nonlinear;

/// The frequencies of the paper `[Hz]`.
const FREQUENCIES: [f64; BANDS] = [1575.42e6, 1227.6e6, 1176e6];

/// The file gives S-RAPC to a tenth of a millimetre.
const ROUNDED: f64 = 0.5e-4;

/// Whether a file is of this kind.
pub fn recognises(root: &Value) -> bool {
    root.get("x0").is_some() && root.get("c").is_some() && root.get("check").is_some()
}

/// Runs it.
pub fn run(source: &Source, report: &mut Report) {
    let outcome = check(root(source), report);
    note("geometry", outcome, report);
}

fn check(root: Inputs, report: &mut Report) -> Result<(), CaseError> {
    let circles = root.rows::<3>("x0")?.into_iter().zip(root.rows::<3>("c")?);
    let geometry = Geometry {
        rate: root.number("n")?,
        point: Vector3::from(root.numbers::<3>("p")?),
        base: Vector3::from(root.numbers::<3>("base")?),
        circles: circles.map(|(start, quarter)| Circle { start: start.into(), quarter: quarter.into() }).collect(),
    };
    let published = geometry == Geometry::g2();
    report.compare("geometry.published", "G2", &published.into(), &true.into(), None);
    let (interval, last) = (root.number("h")?, root.number("K")?);
    for (model, base) in [("DD", Some(geometry.base)), ("SD, all clocks measured", None)] {
        let expected = root.object("expect")?.object(model)?;
        let [filter, smoother] = covariances(&geometry, base, interval, last as usize)?;
        for (key, computed) in [("S-RAPC fixed filter [m]", filter), ("S-RAPC fixed smoother [m]", smoother)] {
            compare(report, "geometry.S-RAPC", &format!("{model}: {key}"), computed, expected.number(key)?, ROUNDED);
        }
    }
    let check = root.object("check")?;
    let (positions, velocities) = (vectors(&check, "S")?, vectors(&check, "V")?);
    for ((k, positions), velocities) in check.list("k")?.into_iter().zip(positions).zip(velocities) {
        let id = format!("k = {k}");
        let satellites = geometry.satellites((k - last / 2.0) * interval);
        compare(report, "geometry.satellites", &id, satellites.len() as f64, positions.len() as f64, 0.0);
        for ((satellite, position), velocity) in satellites.iter().zip(positions).zip(velocities) {
            // Coordinates of 2e7 m in double precision.
            compare(report, "geometry.positions", &id, (satellite.position - position).amax(), 0.0, 2e-8);
            compare(report, "geometry.velocities", &id, (satellite.velocity - velocity).amax(), 0.0, 2e-12);
        }
    }
    Ok(())
}

/// Root of the trace of the position's covariance at half time, in the fixed filter and smoother `[m]`.
fn covariances(
    geometry: &Geometry,
    base: Option<Vector3<f64>>,
    interval: f64,
    last: usize,
) -> Result<[f64; 2], CaseError> {
    let bands = Bands::new(FREQUENCIES).ok_or_else(|| CaseError::Absurd("no such bands".to_owned()))?;
    let settings = Settings::recommended(bands, base);
    let record = |k: usize| {
        let satellites = geometry.satellites((k as f64 - last as f64 / 2.0) * interval);
        let model = settings.model(&satellites);
        let mut values = vec![0.0; model.outputs()];
        model.evaluate(&[0.0; 4], &mut values);
        let (ranges, rates) = values.split_at(values.len() / 2);
        let signals = [ranges.repeat(BANDS), ranges.repeat(BANDS), rates.repeat(BANDS)];
        Record { virtual_rows: vec![0.0; model.virtual_rows()], satellites, signals }
    };
    let records = (0..=last).map(record).collect();
    let mut model = MultiBand::new(settings, records).map_err(|error| CaseError::Absurd(error.to_string()))?;
    let mut integers = vec![];
    for k in 0..model.epochs() {
        model.integers(k, &mut integers);
        model.fix(k, &integers, &vec![0.0; integers.len()]);
    }
    model.settle();
    let mut passes = Passes::new(PassOptions::default());
    passes.forward(&model)?;
    let root = |density: &Density| (0..3).map(|i| density.covariance(i, i)).sum::<f64>().sqrt();
    let mut found = [f64::NAN; 2];
    passes.backward(&model, |epoch| {
        if epoch.k == last / 2 {
            found = [root(epoch.filtered), root(epoch.smoothed)];
        }
    })?;
    Ok(found)
}
