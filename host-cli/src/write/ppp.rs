//! Tables of precise point positioning, as CSV: by epoch, by measurement, and what was learned.

use crate::process::ppp::run::Run;
use crate::smooth::ppp::Smoothed;
use crate::write::files::Csv;
use std::io;
use surefix_core::gnss::satellite::Constellation;
use surefix_core::ppp::Estimate;

/// End of the name and content of each table.
pub type Tables = Vec<(&'static str, Vec<u8>)>;

/// All tables of a run.
pub fn tables(run: &Run, smoothed: Option<&Smoothed>) -> io::Result<Tables> {
    let mut tables = vec![("ppp.csv", epochs(run)?), ("residuals.csv", residuals(run)?)];
    if let Some(smoothed) = smoothed {
        tables.push(("smoothed-residuals.csv", smoothed_residuals(smoothed)?));
        tables.push(("noise.csv", noise(smoothed)?));
        tables.push(("walks.csv", walks(smoothed)?));
        tables.push(("likelihood.csv", likelihood(smoothed)?));
    }
    Ok(tables)
}

fn epochs(run: &Run) -> io::Result<Vec<u8>> {
    let mut header: Vec<String> = ["gps_week", "gps_tow_s", "clock_m", "sd_clock_m"].map(String::from).into();
    for constellation in Constellation::ALL {
        let letter = constellation.letter();
        header.extend([format!("isb_{letter}_m"), format!("sd_isb_{letter}_m")]);
    }
    let rest =
        ["zhd_m", "zwd_m", "sd_zwd_m", "ztd_m", "gradient_n_m", "sd_gradient_n_m", "gradient_e_m", "sd_gradient_e_m"];
    header.extend(rest.map(String::from));
    header.push("clock_jump_m".into());
    let mut csv = Csv::new(header)?;
    for solution in &run.solutions {
        let time = solution.solution.time;
        let both = |estimate: Option<Estimate>| estimate.map_or([f64::NAN; 2], |e| [e.value, e.sigma]);
        let mut row = vec![f64::from(time.week()), time.tow()];
        row.extend(both(solution.clock));
        solution.inter_system.iter().for_each(|&bias| row.extend(both(bias)));
        row.push(solution.zenith_hydrostatic);
        row.extend(both(solution.zenith_wet));
        row.push(solution.zenith_total().unwrap_or(f64::NAN));
        solution.gradients.iter().for_each(|&gradient| row.extend(both(gradient)));
        row.push(solution.clock_jump);
        csv.row(&[], row)?;
    }
    csv.finish()
}

fn residuals(run: &Run) -> io::Result<Vec<u8>> {
    let columns = [
        "satellite",
        "kind",
        "used",
        "gps_week",
        "gps_tow_s",
        "band",
        "arc",
        "azimuth_deg",
        "elevation_deg",
        "residual_m",
        "sigma_m",
        "ambiguity_m",
        "sd_ambiguity_m",
    ];
    let mut csv = Csv::new(columns)?;
    for residual in &run.residuals {
        let time = run.solutions[residual.epoch as usize].solution.time;
        let phase = residual.kind == surefix_core::ppp::link::Kind::Phase;
        let [ambiguity, sigma] = residual.ambiguity.map(|value| if phase { f64::from(value) } else { f64::NAN });
        let texts = [
            residual.satellite.to_string(),
            if phase { "phase" } else { "code" }.into(),
            if residual.rejected { "no" } else { "yes" }.into(),
        ];
        csv.row(
            &[&texts[0], &texts[1], &texts[2]],
            [
                f64::from(time.week()),
                time.tow(),
                f64::from(residual.slot),
                f64::from(residual.arc),
                f64::from(residual.azimuth.to_degrees()),
                f64::from(residual.elevation.to_degrees()),
                f64::from(residual.postfit),
                f64::from(residual.sigma),
                ambiguity,
                sigma,
            ],
        )?;
    }
    csv.finish()
}

fn smoothed_residuals(smoothed: &Smoothed) -> io::Result<Vec<u8>> {
    let columns = ["satellite", "kind", "group", "gps_week", "gps_tow_s", "elevation_deg", "residual_m", "sigma_m"];
    let mut csv = Csv::new(columns)?;
    for epoch in &smoothed.tape.epochs {
        for i in epoch.rows.clone() {
            let row = &smoothed.tape.rows[i];
            let group = &smoothed.tape.groups[usize::from(row.group)].name;
            csv.row(
                &[&row.satellite.to_string(), row.kind.name(), group],
                [
                    f64::from(epoch.time.week()),
                    epoch.time.tow(),
                    row.elevation.to_degrees(),
                    smoothed.residuals[i],
                    smoothed.variances[i].sqrt(),
                ],
            )?;
        }
    }
    csv.finish()
}

fn noise(smoothed: &Smoothed) -> io::Result<Vec<u8>> {
    let mut csv = Csv::new(["pool", "measurements", "sigma_start_m", "sigma_m", "squared_innovations_over_expected"])?;
    for pool in &smoothed.report.pools {
        let numbers = [pool.count as f64, pool.start, pool.end, pool.consistency.unwrap_or(f64::NAN)];
        csv.row(&[&pool.name], numbers)?;
    }
    csv.finish()
}

fn walks(smoothed: &Smoothed) -> io::Result<Vec<u8>> {
    let mut csv = Csv::new(["states", "axis", "step", "sigma"])?;
    for walk in &smoothed.report.walks {
        for (axis, sigmas) in walk.sigmas.iter().enumerate() {
            for (step, &sigma) in sigmas.iter().enumerate() {
                csv.row(&[walk.name], [axis as f64, step as f64, sigma])?;
            }
        }
    }
    csv.finish()
}

fn likelihood(smoothed: &Smoothed) -> io::Result<Vec<u8>> {
    let mut csv = Csv::new(["accelerated", "iteration", "minus_2_ln_l", "objective"])?;
    for (i, step) in smoothed.report.history.iter().enumerate() {
        let accelerated = if step.accelerated { "yes" } else { "no" };
        csv.row(&[accelerated], [i as f64, step.likelihood, step.objective])?;
    }
    csv.finish()
}
