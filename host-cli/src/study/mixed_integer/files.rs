//! The study as files: CSV of every number with all its digits, the figure, and its run as a device log.

use super::super::statistics::both;
use super::acceptance::BANDS;
use super::constellation::Constellation;
use super::detector_curve::{Curve, SIGMA_PROJECTION, SIGMA_WEIGHTED};
use super::trial::{Position, Snapshot};
use super::{Study, device_log, figure, section};
use crate::study::monte_carlo;
use crate::write::files::{Csv, Files, FilesError};
use std::io;
use std::path::{Path, PathBuf};
use surefix_core::filter::slip;

impl Study {
    /// Writes what there is into a directory, which is made if need be. Returns the files.
    pub fn write(&self, directory: &Path) -> Result<Vec<PathBuf>, FilesError> {
        let in_directory = |error| FilesError::Io { path: directory.to_owned(), error };
        let mut files = Files::default();
        if !self.sections.is_empty() {
            files.push("configurations.csv", configurations(self).map_err(in_directory)?);
        }
        if self.sections.iter().any(|(section, _)| section.part == super::Part::Acceptance) {
            files.push("acceptance.csv", acceptance(self).map_err(in_directory)?);
        }
        if let Some(curves) = &self.curves {
            files.push("detectors.csv", detectors(curves).map_err(in_directory)?);
        }
        if let Some(track) = &self.track {
            files.push("figure1.csv", epochs(track).map_err(in_directory)?);
            files.draw("figure1", &figure::draw(track, self.settings.seed))?;
            files.push("figure1.sfl", self.track_as_log().map_err(in_directory)?);
        }
        files.write(directory)
    }
}

impl Study {
    /// The measurements of the run in the figure.
    fn track_as_log(&self) -> io::Result<Vec<u8>> {
        let random = monte_carlo::stream(self.settings.seed, 0);
        device_log::record(&section::nominal(), &Constellation::new(), random).map(|(log, _)| log)
    }
}

fn configurations(study: &Study) -> io::Result<Vec<u8>> {
    #[rustfmt::skip]
    let mut table = Csv::new([
        "table", "row", "rule", "detector", "fixing", "output",
        "prior_sigma_m", "jump_probability", "threshold_cycles", "sigma_stay_cycles", "bias_walk_m2_per_s",
        "right", "right_se", "single", "single_se",
        "rmse_constrained_m", "rmse_constrained_m_se", "nees_constrained", "nees_constrained_se",
        "inside_95_constrained", "inside_95_constrained_se", "largest_constrained_m",
        "rmse_relaxed_m", "rmse_relaxed_m_se", "nees_relaxed", "nees_relaxed_se",
        "inside_95_relaxed", "inside_95_relaxed_se", "largest_relaxed_m",
        "false_alarms", "false_alarms_se", "detections", "detections_se", "refused_epochs",
        "reference_right", "reference_rmse_constrained_m", "reference_nees_constrained", "reference_nees_relaxed",
    ])?;
    for (section, outcomes) in &study.sections {
        for (row, outcome) in section.rows.iter().zip(outcomes) {
            let (scenario, options) = (&row.configuration.scenario, &row.configuration.options);
            let names = [
                format!("{:?}", section.part),
                row.label.clone(),
                format!("{:?}", options.rule),
                format!("{:?}", options.detector),
                format!("{:?}", options.fixing),
                format!("{:?}", options.output),
            ];
            let settings = [
                scenario.position_sigma,
                scenario.jumps.probability,
                options.threshold,
                options.sigma_stay,
                scenario.parameters.bias_walk,
            ];
            let positions = [outcome.constrained, outcome.relaxed].map(|position| {
                let [rmse, nees, inside] = [position.rmse, position.nees, position.inside].map(both);
                [rmse[0], rmse[1], nees[0], nees[1], inside[0], inside[1], position.largest]
            });
            let reference = &row.reference;
            let reference = [reference.right, reference.rmse, reference.nees, reference.relaxed_nees];
            let numbers = settings
                .into_iter()
                .chain([outcome.right, outcome.single].map(both).into_iter().flatten())
                .chain(positions.into_iter().flatten())
                .chain([outcome.false_alarms, outcome.detections].map(both).into_iter().flatten())
                .chain([outcome.refused as f64])
                .chain(reference.map(|number| number.unwrap_or(f64::NAN)));
            table.row(&names.each_ref().map(String::as_str), numbers)?;
        }
    }
    table.finish()
}

fn acceptance(study: &Study) -> io::Result<Vec<u8>> {
    let mut table =
        Csv::new(["quantity", "unit", "rule", "verdict", "value", "standard_error", "band_low", "band_high"])?;
    for (section, outcomes) in study.sections.iter().filter(|(section, _)| section.part == super::Part::Acceptance) {
        for band in &BANDS {
            for (row, outcome) in section.rows.iter().zip(outcomes) {
                let estimate = (band.of)(outcome);
                let verdict = if band.accepts(estimate.value) { "inside" } else { "outside" };
                let numbers = [estimate.value, estimate.standard_error, band.low, band.high];
                table.row(&[band.quantity, band.unit, &row.label, verdict], numbers)?;
            }
        }
    }
    table.finish()
}

fn detectors(curves: &[Curve; 2]) -> io::Result<Vec<u8>> {
    #[rustfmt::skip]
    let mut table = Csv::new([
        "detector", "threshold_cycles", "false_alarms", "false_alarms_se", "false_alarms_analytic",
        "detections_1", "detections_1_se", "detections_1_analytic", "detections_2", "detections_2_se",
        "detections_2_analytic", "detections_any", "detections_any_se",
    ])?;
    for (curve, name, sigma) in [(&curves[0], "projection", SIGMA_PROJECTION), (&curves[1], "weighted", SIGMA_WEIGHTED)]
    {
        for point in &curve.points {
            let d = point.threshold;
            let [alarms, one, two, any] =
                [point.false_alarms, point.detections[0], point.detections[1], point.detections[2]].map(both);
            let analytic = |size| slip::detection_rate(d, size, sigma);
            #[rustfmt::skip]
            let numbers = [
                d, alarms[0], alarms[1], slip::false_alarm_rate(d, sigma), one[0], one[1], analytic(1.0),
                two[0], two[1], analytic(2.0), any[0], any[1],
            ];
            table.row(&[name], numbers)?;
        }
    }
    table.finish()
}

fn epochs(track: &[Snapshot]) -> io::Result<Vec<u8>> {
    let mut header = vec!["time_s".to_owned()];
    for density in ["relaxed", "constrained"] {
        for axis in ["east", "north", "up"] {
            header.extend([format!("{density}_{axis}_error_m"), format!("{density}_{axis}_sd_m")]);
        }
    }
    let count = track.first().map_or(0, |snapshot| snapshot.jumps.len());
    for quantity in ["real_error", "integer_error", "jump", "flag"] {
        header.extend((1..=count).map(|i| format!("n{i}_{quantity}")));
    }
    let mut table = Csv::new(&header)?;
    for snapshot in track {
        let axes = |position: &Position| {
            let (error, covariance) = (position.error, position.covariance);
            (0..3).flat_map(move |axis| [error[axis], covariance[(axis, axis)].sqrt()])
        };
        let numbers = [snapshot.time]
            .into_iter()
            .chain(axes(&snapshot.relaxed))
            .chain(axes(&snapshot.constrained))
            .chain(snapshot.float_errors)
            .chain(snapshot.integer_errors.map(|error| error as f64))
            .chain(snapshot.jumps.map(|jump| jump as f64))
            .chain(snapshot.flags.map(|flag| f64::from(u8::from(flag))));
        table.row(&[], numbers)?;
    }
    table.finish()
}
