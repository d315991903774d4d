//! Algorithm 1 with the model of Section V: measurements in, both densities, slips and integers out, epoch by epoch, from
//! arithmetic of 60 digits.

use super::inputs::{CaseError, Inputs};
use super::integer::compare;
use super::{Report, Source, rule};
use nalgebra::Vector3;
use serde_json::{Value, json};
use surefix_core::filter::mixed_integer::{Fixing, MixedIntegerFilter, Options};
use surefix_core::filter::update::Form;
use surefix_core::linalg::Mat;
use surefix_core::model::virtual_bias::{VirtualBiasModel, VirtualBiasParameters};

/// Room for 24 satellites.
type Filter = MixedIntegerFilter<f64, 101, 78, 23, 46>;

/// Whether a file is of this kind.
pub fn recognises(root: &Value) -> bool {
    root.get("epochs").is_some() && root.get("sats").is_some()
}

/// Runs it with every form of the update.
pub fn run(source: &Source, report: &mut Report) {
    for (form, name) in [(Form::Sequential, "sequential"), (Form::Joseph, "joseph"), (Form::Array, "array")] {
        if let Err(error) = run_form(Inputs(&source.root), form, name, report) {
            report.unreadable(name, error);
        }
    }
}

fn run_form(root: Inputs, form: Form, name: &str, report: &mut Report) -> Result<(), CaseError> {
    let parameters = root.object("params")?;
    let satellites: Vec<Vector3<f64>> = root.rows::<3>("sats")?.into_iter().map(Vector3::from).collect();
    let model = VirtualBiasModel {
        satellites: &satellites,
        parameters: VirtualBiasParameters {
            interval: parameters.number("h")?,
            acceleration: parameters.number("alpha")?,
            bias_walk: parameters.number("beta")?,
            wavelength: parameters.number("lam")?,
            sigma_code: parameters.number("s_P")?,
            sigma_phase: parameters.number("s_Phi")?,
            sigma_bias: parameters.number("s_th")?,
        },
    };
    let prior = root.object("prior")?;
    let (m_x, m_n) = (prior.list("m_x")?, prior.list("m_n")?);
    let (p_x, p_n) = (prior.list_of("P_xx_diag", m_x.len())?, prior.list_of("P_nn_diag", m_n.len())?);
    let fixing = match parameters.text("ar")? {
        "lambda" => Fixing::LeastSquares,
        "bootstrapping" | "bootstrap" => Fixing::Bootstrapping,
        other => return Err(CaseError::Absurd(format!("no integer estimation \"{other}\""))),
    };
    let options = Options {
        rule: rule::read(&parameters.0["rule"])?,
        form,
        threshold: parameters.number("d")?,
        sigma_jump: parameters.number("s_jump")?,
        sigma_stay: parameters.number("s_stay")?,
        fixing,
        ..Options::default()
    };
    let mut filter = Box::new(Filter::new(options));
    filter.reset_independent(m_x.len(), &[&*m_x, &m_n].concat(), &[&*p_x, &p_n].concat())?;

    let tolerances = root.object("tol")?;
    let (tol_mean, tol_var) = (tolerances.number("mean")?, tolerances.number("var")?);
    for (k, epoch) in root.objects("epochs")?.into_iter().enumerate() {
        let id = format!("epoch {}", k + 1);
        filter.step(&model, &epoch.list("y")?)?;
        let densities = [
            ("relaxed", filter.mean(), filter.covariance(), "m_f", "P_f_diag"),
            ("constrained", filter.constrained_mean(), filter.constrained_covariance(), "m_c", "P_c_diag"),
        ];
        for (density, mean, covariance, m, p) in densities {
            let (m, p) = (epoch.list_of(m, mean.len())?, epoch.list_of(p, mean.len())?);
            for i in 0..mean.len() {
                let variance = covariance.get(i, i).unwrap_or(f64::NAN);
                let deviation = (mean[i] - m[i]) / p[i].sqrt();
                compare(report, &format!("{name}.{density}.mean"), &id, deviation, 0.0, tol_mean);
                compare(report, &format!("{name}.{density}.variance"), &id, variance / p[i], 1.0, tol_var);
            }
        }
        let estimates = filter.slip_estimates();
        // In units of the jump that would be flagged; a tolerance on the mean is one on the innovation.
        for (computed, expected) in estimates.iter().zip(epoch.list_of("dn", estimates.len())?) {
            compare(report, &format!("{name}.slip_estimates"), &id, *computed, expected, tol_mean);
        }
        let flags: Vec<u8> = filter.slips().iter().map(|&flag| u8::from(flag)).collect();
        report.compare(&format!("{name}.slips"), &id, &json!(flags), &json!(epoch.list("c")?), Some(0.0));
        let integers = json!(epoch.list("n_I")?);
        report.compare(&format!("{name}.integers"), &id, &json!(filter.integers()), &integers, Some(0.0));
    }
    for (density, covariance, key) in
        [("relaxed", filter.covariance(), "final_P_f"), ("constrained", filter.constrained_covariance(), "final_P_c")]
    {
        let expected = root.square_of(key, covariance.rows())?;
        compare_covariance(report, &format!("{name}.{density}.covariance"), covariance, &expected, tol_var);
    }
    Ok(())
}

/// Compares all entries relative to the standard deviations.
fn compare_covariance(report: &mut Report, check: &str, computed: Mat<'_, f64>, expected: &[f64], tolerance: f64) {
    let n = computed.rows();
    for i in 0..n {
        for j in 0..n {
            let scale = (expected[i * (n + 1)] * expected[j * (n + 1)]).sqrt();
            let deviation = (computed.get(i, j).unwrap_or(f64::NAN) - expected[i * n + j]) / scale;
            compare(report, check, "last epoch", deviation, 0.0, tolerance);
        }
    }
}
