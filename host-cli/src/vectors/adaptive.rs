//! Adaptive measurement noise: sequences of β, and R* step by step in all its forms.

use super::inputs::{CaseError, Inputs};
use super::integer::{compare, first_case_has, run_cases};
use super::{Report, Source};
use serde_json::{Value, json};
use surefix_core::filter::adaptive::forgetting::{Beta, Forgetting};
use surefix_core::filter::adaptive::{matrix, ratio};
use surefix_core::linalg::{Mat, MatMut, eigen};

/// β by Wang et al. (2022), eq. (24), and by Sage and Husa.
pub mod forgetting {
    use super::*;

    /// Eq. (24) as printed, for any success rate.
    const LITERAL: Forgetting = Forgetting::SuccessRate { threshold: 0.0, b: 0.97, bounds: [0.0, 1.0] };

    /// Whether a file is of this kind.
    pub fn recognises(root: &Value) -> bool {
        first_case_has(root, "beta0") && root["sage_husa"].is_array()
    }

    /// Runs all its cases.
    pub fn run(source: &Source, report: &mut Report) {
        let tolerance = source.root["abs_tol"].as_f64().unwrap_or(1e-13);
        run_cases(source, report, |id, case, report| run_case(id, case, tolerance, report));
        for entry in source.root["sage_husa"].as_array().into_iter().flatten() {
            if let Err(error) = run_sage_husa(Inputs(entry), tolerance, report) {
                report.unreadable("sage_husa", error);
            }
        }
    }

    fn run_case(id: &str, case: Inputs, tolerance: f64, report: &mut Report) -> Result<(), CaseError> {
        let mut beta = Beta::new(case.number("beta0")?);
        if case.0.get("ps").is_some() {
            let rates = case.list("ps")?;
            let computed: Vec<f64> = rates.iter().map(|&p| beta.next(&LITERAL, p)).collect();
            report.compare("beta.varying", id, &json!(computed), &case.0["beta"], Some(tolerance));
            return Ok(());
        }
        let (p, epochs) = (case.number("P")?, case.list("at")?);
        let mut sequence = Vec::new();
        let mut k = 0.0;
        for at in epochs {
            while k < at {
                beta.next(&LITERAL, p);
                k += 1.0;
            }
            sequence.push(beta.get());
        }
        for key in ["seq", "closed"] {
            report.compare(&format!("beta.{key}"), id, &json!(sequence), &case.0[key], Some(tolerance));
        }
        // Far on it is at its limit; at P = 1 it goes there as 1/k.
        (0..100_000).for_each(|_| {
            beta.next(&LITERAL, p);
        });
        report.compare(
            "beta.limit",
            id,
            &json!(beta.get()),
            &json!(case.number("limit")?),
            Some(1e-12f64.max(if p == 1.0 { 1.1e-5 } else { 0.0 })),
        );
        Ok(())
    }

    fn run_sage_husa(entry: Inputs, tolerance: f64, report: &mut Report) -> Result<(), CaseError> {
        let (b, expected) = (entry.number("b")?, entry.list("d")?);
        let mut beta = Beta::new(1.0);
        let forgetting = Forgetting::SageHusa { b };
        let later = expected.iter().skip(1).map(|_| beta.next(&forgetting, f64::NAN));
        let computed: Vec<f64> = std::iter::once(1.0).chain(later).collect();
        report.compare("beta.sage_husa", &format!("b = {b}"), &json!(computed), &json!(expected), Some(tolerance));
        Ok(())
    }
}

/// R* over some epochs, from recorded innovations and residuals.
pub mod chain {
    use super::*;

    /// Bounds of the file's floors, as its `doc` says.
    const BOUNDS: [f64; 2] = [0.25, 1e4];

    /// Whether a file is of this kind.
    pub fn recognises(root: &Value) -> bool {
        root["R0"].is_array() && root["steps"].is_array()
    }

    /// Runs it.
    pub fn run(source: &Source, report: &mut Report) {
        if let Err(error) = run_file(Inputs(&source.root), report) {
            report.unreadable("R*", error);
        }
    }

    fn run_file(root: Inputs, report: &mut Report) -> Result<(), CaseError> {
        let (m, start) = root.square("R0")?;
        let tolerance = root.number("rel_tol")?;
        let r0 = Mat::square(&start, m)?;
        let of_r0 = |i: usize| r0.get(i, i).unwrap_or(f64::NAN);
        let [mut full, mut floored, mut residual, mut scaled] = [(); 4].map(|()| start.clone());
        let (mut ratios, mut types) = (vec![1.0; m], [1.0; 4]);
        for (k, step) in root.objects("steps")?.into_iter().enumerate() {
            let id = format!("step {k}");
            let beta = step.number("beta")?;
            let (nu, eps) = (step.list_of("nu", m)?, step.list_of("eps", m)?);
            let (prior, posterior) = (step.square_of("HPH", m)?, step.square_of("HPH_post", m)?);
            let (prior, posterior) = (Mat::square(&prior, m)?, Mat::square(&posterior, m)?);
            let mut same = |check: &str, computed: &[f64], key: &str| -> Result<(), CaseError> {
                for (computed, expected) in computed.iter().zip(step.square_of(key, m)?) {
                    compare(report, check, &id, *computed, expected, tolerance);
                }
                Ok(())
            };
            matrix::blend(&mut MatMut::square(&mut full, m)?, beta, &nu, prior, matrix::Form::Innovation)?;
            same("noise.literal", &full, "R_full")?;
            matrix::blend(&mut MatMut::square(&mut residual, m)?, beta, &eps, posterior, matrix::Form::Residual)?;
            same("noise.residual", &residual, "R_resid")?;
            matrix::blend(&mut MatMut::square(&mut floored, m)?, beta, &nu, prior, matrix::Form::Innovation)?;
            let [mut factor, mut square, mut vectors] = [(); 3].map(|()| vec![0.0; m * m]);
            let mut work = matrix::FloorWork {
                factor: MatMut::square(&mut factor, m)?,
                square: MatMut::square(&mut square, m)?,
                vectors: MatMut::square(&mut vectors, m)?,
                values: &mut vec![0.0; m],
            };
            matrix::floor(&mut MatMut::square(&mut floored, m)?, r0, BOUNDS, &mut work)?;
            same("noise.floor", &floored, "R_floor")?;
            for (i, ratio) in ratios.iter_mut().enumerate() {
                let sample = (nu[i] * nu[i] - prior.get(i, i).unwrap_or(f64::NAN)) / of_r0(i);
                *ratio = ratio::blend(*ratio, beta, sample, BOUNDS);
            }
            ratio::scale(&mut MatMut::square(&mut scaled, m)?, r0, &ratios)?;
            same("noise.per_channel", &scaled, "R_diag")?;
            for (computed, expected) in ratios.iter().zip(step.list_of("ratio", m)?) {
                compare(report, "noise.ratio", &id, *computed, expected, tolerance);
            }
            let (mut spoilt, mut values) = (full.clone(), vec![0.0; m]);
            eigen::eigenvalues(&mut MatMut::square(&mut spoilt, m)?, &mut values)?;
            let least = values.iter().copied().fold(f64::INFINITY, f64::min);
            compare(report, "noise.literal_least_eigenvalue", &id, least, step.number("min_eig_full")?, tolerance);
            for (kind, (scale, expected)) in types.iter_mut().zip(step.list_of("scale", 4)?).enumerate() {
                let (size, first) = (m / 4, kind * m / 4);
                let block = |matrix: Mat<'_, f64>| -> Result<Vec<f64>, CaseError> {
                    let block = matrix.block(first, first, size, size)?;
                    Ok((0..size).flat_map(|i| block.row(i).iter().copied()).collect())
                };
                let (r0, mut spread) = (block(r0)?, block(posterior)?);
                let mut factor = vec![0.0; size * size];
                let mut factor = MatMut::square(&mut factor, size)?;
                ratio::factor(Mat::square(&r0, size)?, &mut factor)?;
                let mut eps = eps[first..first + size].to_vec();
                let sample = ratio::mean_ratio(factor.as_ref(), &mut eps, &mut MatMut::square(&mut spread, size)?)?;
                *scale = ratio::blend(*scale, beta, sample, [0.0, f64::INFINITY]);
                compare(report, "noise.per_type", &id, *scale, expected, tolerance);
            }
        }
        Ok(())
    }
}
