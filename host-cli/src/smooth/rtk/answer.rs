//! From a smoothed density to a solution.

use super::model::RtkModel;
use crate::smooth::model::Density;
use nalgebra::{Matrix3, Vector3};
use surefix_core::gnss::solution::{Quality, Reason, Solution};

/// Fewest fixed double differences of a fixed solution: those that determine a position.
const FEWEST: usize = 3;

/// Double differences of an epoch that may be fixed, and those that are.
pub fn ambiguities(model: &RtkModel<'_>, epoch: usize) -> [usize; 2] {
    let tape = model.tape();
    let mask = tape.config().acceptance.elevation_mask.sin();
    // Of each group the arcs that may be fixed, and the clusters that they are in.
    let mut groups: Vec<(usize, Vec<usize>)> = vec![(0, Vec::new()); tape.groups().len()];
    for link in tape.links(epoch) {
        let Some(arc) = tape.arcs().get(link.arc as usize) else { continue };
        if arc.integer && f64::from(link.sin_elevation) >= mask {
            let (count, clusters) = &mut groups[arc.group];
            *count += 1;
            let cluster = model.clusters().find(link.arc as usize).0;
            if !clusters.contains(&cluster) {
                clusters.push(cluster);
            }
        }
    }
    let usable = groups.iter().map(|(count, _)| count.saturating_sub(1)).sum();
    let fixed = groups.iter().map(|(count, clusters)| count - clusters.len()).sum();
    [usable, fixed]
}

/// Writes the smoothed position and velocity, and their grade, into the solution of an epoch.
pub fn answer(
    model: &RtkModel<'_>,
    epoch: usize,
    smoothed: &Density,
    phase_centres: [f64; 2],
    solution: &mut Solution,
) {
    let Some(frame) = model.tape().frame() else { return };
    let to_ecef = frame.rotation.transpose();
    let part = |first: usize| {
        let mean = Vector3::from_fn(|i, _| smoothed.mean[first + i]);
        (to_ecef * mean, Matrix3::from_fn(|i, j| smoothed.covariance(first + i, first + j)))
    };
    let [horizontal, vertical] = phase_centres.map(|sigma| sigma * sigma);
    let constant = Matrix3::from_diagonal(&Vector3::new(horizontal, horizontal, vertical));
    let (position, covariance) = part(0);
    solution.position = frame.origin + position;
    solution.position_covariance = to_ecef * (covariance + constant) * frame.rotation;
    if model.tape().config().motion.order() > 1 {
        let (velocity, covariance) = part(3);
        solution.velocity = velocity;
        solution.velocity_covariance = to_ecef * covariance * frame.rotation;
    }
    let [usable, fixed] = ambiguities(model, epoch);
    solution.ambiguities = usable.min(255) as u8;
    solution.ambiguities_fixed = fixed.min(255) as u8;
    let grade = if fixed < FEWEST {
        (Quality::Float, if usable < FEWEST { Reason::TooFewAmbiguities } else { Reason::RatioLow })
    } else if fixed < usable {
        (Quality::Partial, Reason::SubsetOnly)
    } else {
        (Quality::Fixed, Reason::Complete)
    };
    (solution.quality, solution.reason) = grade;
}
