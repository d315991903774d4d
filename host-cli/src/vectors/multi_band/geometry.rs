//! Geometry G2: satellites on great circles about a fixed point, by the numbers of the file and by those of the study.

use super::super::integer::compare;
use super::{CaseError, Inputs, Report, Source, note, root, vectors};
use crate::study::smoothing::geometry::{Circle, Geometry};
use nalgebra::Vector3;
use serde_json::Value;

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
