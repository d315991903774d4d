//! From a smoothed density to a solution.

use super::model::RtkModel;
use crate::smooth::model::{Density, Integer};
use nalgebra::{Matrix3, Vector3};
use surefix_core::gnss::solution::{Quality, Reason, Solution};
use surefix_core::integrity::protection::Status;

/// Fewest fixed double differences of a fixed solution: those that determine a position.
const FEWEST: usize = 3;

/// Double differences of an epoch that may be fixed, and those that are: by the model, or among `integers`, which are
/// fixed in this epoch only.
pub fn ambiguities(model: &RtkModel<'_>, epoch: usize, integers: &[Integer]) -> [usize; 2] {
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
            let mut pairs = integers.iter().map(|integer| model.layouts().pairs[integer.arc]);
            let cluster = pairs.find(|pair| pair[0] == cluster).map_or(cluster, |[_, reference]| reference);
            if !clusters.contains(&cluster) {
                clusters.push(cluster);
            }
        }
    }
    let usable = groups.iter().map(|(count, _)| count.saturating_sub(1)).sum();
    let fixed = groups.iter().map(|(count, clusters)| count - clusters.len()).sum();
    [usable, fixed]
}

/// Writes the smoothed position and velocity, and their grade, into the solution of an epoch, given the `integers` fixed
/// in this epoch only.
pub fn answer(
    model: &RtkModel<'_>,
    epoch: usize,
    smoothed: &Density,
    integers: &[Integer],
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
    let [usable, fixed] = ambiguities(model, epoch, integers);
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
    // What the engine said of its own position bounds no other one.
    (solution.protection, solution.integrity) = (None, Status::Unmonitored);
}

#[cfg(test)]
mod tests {
    use super::super::tests::{drive, model};
    use super::*;
    use crate::smooth::model::Model;

    fn solution(model: &RtkModel<'_>, integers: &[Integer]) -> (Solution, Density) {
        let mut density = Density::default();
        let n = model.states(4);
        density.reset(n);
        density.mean[..6].copy_from_slice(&[1.0, 2.0, 3.0, 0.1, 0.2, 0.3]);
        (0..n).for_each(|i| density.covariance[i * n + i] = 1e-4 * (i + 1) as f64);
        let mut solution = model.tape().solutions()[4];
        answer(model, 4, &density, integers, [0.03, 0.04], &mut solution);
        (solution, density)
    }

    #[test]
    fn position_and_velocity_are_turned_back_and_the_antennas_are_added() {
        let (tape, _) = drive(5.0);
        let model = model(&tape);
        let (solution, _) = solution(&model, &[]);
        assert!(tape.solutions()[4].protection.is_some());
        assert_eq!((solution.protection, solution.integrity), (None, Status::Unmonitored));
        let frame = tape.frame().unwrap();
        let enu = frame.rotation * (solution.position - frame.origin);
        assert!((enu - Vector3::new(1.0, 2.0, 3.0)).norm() < 1e-8, "{enu}");
        assert!((frame.rotation * solution.velocity - Vector3::new(0.1, 0.2, 0.3)).norm() < 1e-12);
        let turned = |covariance: Matrix3<f64>| (frame.rotation * covariance * frame.rotation.transpose()).diagonal();
        let expected = Vector3::new(1e-4 + 9e-4, 2e-4 + 9e-4, 3e-4 + 16e-4);
        assert!((turned(solution.position_covariance) - expected).norm() < 1e-12);
        assert!((turned(solution.velocity_covariance) - Vector3::new(4e-4, 5e-4, 6e-4)).norm() < 1e-12);
    }

    /// Graded alike, whether the model knows the integers or this epoch alone does.
    #[test]
    fn the_grade_follows_the_fixed_double_differences() {
        let (tape, _) = drive(5.0);
        let mut model = model(&tape);
        let mut integers = Vec::new();
        model.integers(4, &mut integers);
        let [usable, fixed] = ambiguities(&model, 4, &[]);
        assert!(usable > 4 && fixed == 0 && integers.len() >= usable, "{usable} {fixed}");
        let grade = |model: &RtkModel<'_>, integers: &[Integer]| {
            let (solution, _) = solution(model, integers);
            assert_eq!(
                [solution.ambiguities, solution.ambiguities_fixed].map(usize::from),
                ambiguities(model, 4, integers)
            );
            (solution.quality, solution.reason)
        };
        assert_eq!(grade(&model, &[]), (Quality::Float, Reason::RatioLow));
        assert_eq!(grade(&model, &integers[..2]), (Quality::Float, Reason::RatioLow));
        assert_eq!(grade(&model, &integers[..4]), (Quality::Partial, Reason::SubsetOnly));
        assert_eq!(grade(&model, &integers), (Quality::Fixed, Reason::Complete));
        assert_eq!(ambiguities(&model, 4, &integers), [usable; 2]);
        let by_epoch = ambiguities(&model, 4, &integers[..4]);
        model.fix(0, &integers[..4], &[0.0; 4]);
        assert_eq!(ambiguities(&model, 4, &[]), by_epoch);
    }
}
