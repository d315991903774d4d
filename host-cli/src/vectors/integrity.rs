//! Integrity: K factors of risk allocations, and the classes of the Stanford diagram.

use super::inputs::{CaseError, Inputs};
use super::{Report, Source};
use serde_json::{Value, json};
use surefix_core::integrity::risk::{given_right_integers, one_dimension, two_dimensions};
use surefix_core::integrity::stanford::Counts;

/// K factors: p by the allocation, K of one dimension, of the circle, and by axis ratio.
pub mod factors {
    use super::super::integer::{first_case_has, run_cases};
    use super::*;

    /// As the file says: of ratios below 1, and of all else.
    const TOLERANCES: [f64; 2] = [1e-9, 1e-12];

    /// Whether a file is of this kind.
    pub fn recognises(root: &Value) -> bool {
        first_case_has(root, "k_h_exact_on_drms_by_axis_ratio")
    }

    /// Runs all its cases.
    pub fn run(source: &Source, report: &mut Report) {
        run_cases(source, report, run_case);
    }

    fn run_case(id: &str, case: Inputs, report: &mut Report) -> Result<(), CaseError> {
        let [ratios, all] = TOLERANCES;
        let mut compare = |check: &str, computed: f64, key: f64, tolerance: f64| {
            report.compare(check, id, &json!(computed), &json!(key), Some(tolerance));
        };
        let p = given_right_integers(case.number("I")?, case.number("pif")?);
        compare("integrity.p", p, case.number("p")?, all * p);
        compare("integrity.k_vertical", one_dimension(p), case.number("k_v")?, all);
        compare("integrity.k_horizontal", two_dimensions(p, 0.0), case.number("k_h_1d_on_drms")?, all);
        let circle = two_dimensions(p, 1.0);
        compare("integrity.k_circle", circle, case.number("k_h_rayleigh_on_drms")?, all);
        let on_major = circle * 2f64.sqrt();
        compare("integrity.k_circle_on_axis", on_major, case.number("k_h_rayleigh_on_sigma_major")?, 2.0 * all);
        let by_ratio = case.object("k_h_exact_on_drms_by_axis_ratio")?;
        for (ratio, expected) in by_ratio.0.as_object().into_iter().flatten() {
            let value: f64 = ratio.parse().map_err(|_| CaseError::Absurd(format!("axis ratio {ratio}")))?;
            let expected = expected.as_f64().ok_or_else(|| CaseError::Absurd(format!("K of axis ratio {ratio}")))?;
            let tolerance = if value < 1.0 { ratios } else { all };
            compare("integrity.k_exact", two_dimensions(p, value), expected, tolerance);
        }
        Ok(())
    }
}

/// Errors and protection levels in, rates of the classes out.
pub mod stanford {
    use super::*;

    /// Whether a file is of this kind.
    pub fn recognises(root: &Value) -> bool {
        root["pe"].is_array() && root["pl"].is_array() && root["rates"].is_object()
    }

    /// Runs it.
    pub fn run(source: &Source, report: &mut Report) {
        if let Err(error) = run_file(Inputs(&source.root), report) {
            report.unreadable("stanford", error);
        }
    }

    fn run_file(root: Inputs, report: &mut Report) -> Result<(), CaseError> {
        let errors = root.list("pe")?;
        let levels = root.list_of("pl", errors.len())?;
        let limit = root.number("al")?;
        let mut counts = Counts::default();
        // The file's "MI" is that of available epochs; those that are warned of stand apart.
        for (&error, &level) in errors.iter().zip(&levels) {
            if counts.add(error, level, limit).is_none() {
                return Err(CaseError::Absurd("an error or a level is not a number".into()));
            }
        }
        let rates = root.object("rates")?;
        let computed = [
            ("nominal", counts.nominal),
            ("MI", counts.misleading),
            ("HMI", counts.hazardously_misleading),
            ("false_alert", counts.false_alerts),
            ("true_alert", counts.true_alerts),
            ("mi_unav", counts.unavailable_misleading),
            ("pe_gt_pl", counts.beyond()),
        ];
        for (name, count) in computed {
            let rate = count as f64 / errors.len() as f64;
            report.compare(
                &format!("stanford.{name}"),
                "rates",
                &json!(rate),
                &json!(rates.number(name)?),
                Some(1e-15),
            );
        }
        Ok(())
    }
}
