//! Slip detection: innovations and G in, jump estimates, flags and variances out; and the mass and moments of the jump
//! process.

use super::inputs::{CaseError, Inputs};
use super::integer::{compare, first_case_has, run_cases};
use super::{Report, Source};
use serde_json::{Value, json};
use surefix_core::filter::jump::JumpProcess;
use surefix_core::filter::slip::{jumped, project, project_weighted, sigma};
use surefix_core::linalg::MatMut;
use surefix_core::linalg::triangular::invert;

/// Whether a file is of this kind.
pub fn recognises(root: &Value) -> bool {
    first_case_has(root, "dy") || root.get("jump_pmf").is_some()
}

/// Runs all its cases, and its table of the jump process.
pub fn run(source: &Source, report: &mut Report) {
    run_cases(source, report, run_case);
    for table in ["jump_pmf", "jump_moments"] {
        for entry in source.root[table].as_array().map_or(&[][..], Vec::as_slice) {
            if let Err(error) = run_jump(Inputs(entry), report) {
                report.unreadable(table, error);
            }
        }
    }
}

fn run_case(id: &str, case: Inputs, report: &mut Report) -> Result<(), CaseError> {
    let (m, n, mut g) = case.matrix("G")?;
    let mut innovation = case.list_of("dy", m)?;
    let (mut factor, mut estimate) = (vec![0.0; n * n], vec![0.0; n]);
    let mut factor = MatMut::square(&mut factor, n)?;
    let mut g = MatMut::new(&mut g, m, n, n)?;
    if case.0.get("S").is_some() {
        let mut s = case.square_of("S", m)?;
        project_weighted(&mut g, &mut innovation, &mut MatMut::square(&mut s, m)?, &mut factor, &mut estimate)?;
        for (computed, expected) in estimate.iter().zip(case.list_of("dn_gls", n)?) {
            compare(report, "slip.weighted", id, *computed, expected, 1e-12);
        }
        // Gᵀ S⁻¹ G = R Rᵀ with the lower factor R: its inverse is the covariance of the estimate.
        invert(&mut factor)?;
        let entry = |k: usize, i: usize| if i <= k { factor.get(k, i).unwrap_or(f64::NAN) } else { 0.0 };
        for (k, expected) in case.square_of("cov_gls", n)?.into_iter().enumerate() {
            let computed: f64 = (0..n).map(|row| entry(row, k / n) * entry(row, k % n)).sum();
            compare(report, "slip.weighted_covariance", id, computed, expected, 1e-12);
        }
        return Ok(());
    }
    project(&mut g, &innovation, &mut factor, &mut estimate)?;
    let (d, s_jump, s_stay) = (case.number("d")?, case.number("s_jump")?, case.number("s_stay")?);
    let flags: Vec<u8> = estimate.iter().map(|&estimate| u8::from(jumped(estimate, d))).collect();
    report.compare("slip.flags", id, &json!(flags), &json!(case.list_of("c", n)?), Some(0.0));
    for (i, (dn, v)) in case.list_of("dn", n)?.into_iter().zip(case.list_of("V", n)?).enumerate() {
        compare(report, "slip.projection", id, estimate[i], dn, 1e-12);
        compare(report, "slip.variance", id, sigma(flags[i] == 1, s_jump, s_stay).powi(2), v, 1e-12);
    }
    Ok(())
}

fn run_jump(entry: Inputs, report: &mut Report) -> Result<(), CaseError> {
    let largest = u32::try_from(entry.integer("a")?).map_err(|error| CaseError::Absurd(error.to_string()))?;
    let process = JumpProcess { largest, probability: entry.number("b")? };
    let id = format!("a = {largest}, b = {}", process.probability);
    if entry.0.get("p").is_some() {
        let mass = process.mass(i64::from(entry.integer("s")?));
        compare(report, "jump.mass", &id, mass, entry.number("p")?, 1e-12);
    } else {
        compare(report, "jump.mean", &id, process.mean(), entry.number("mean")?, 1e-12);
        compare(report, "jump.variance", &id, process.variance(), entry.number("var")?, 1e-12);
    }
    Ok(())
}
