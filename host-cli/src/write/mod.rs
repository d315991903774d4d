//! Writers of results: one format a file. They know core types only, not the readers.

pub mod csv;
pub mod files;
pub mod partial_file;
pub mod pos;
pub mod ppp;
mod rinex_header;
pub mod rinex_navigation;
pub mod rinex_observation;
pub mod summary;

use nalgebra::{Matrix3, Vector3};
use surefix_core::gnss::geodesy::Geodetic;
use surefix_core::gnss::solution::Solution;

/// The vector from a moving base and its covariance: east, north, up of the place where it begins `[m]`, `[m²]`.
fn local_vector(solution: &Solution) -> Option<(Vector3<f64>, Matrix3<f64>)> {
    let base = solution.base?;
    let rotation = Geodetic::from_ecef(&base).enu_rotation();
    let covariance = rotation * solution.position_covariance * rotation.transpose();
    Some((rotation * (solution.position - base), covariance))
}
