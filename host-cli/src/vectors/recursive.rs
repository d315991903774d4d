//! Recursive mixed-integer least squares with a static x: measurements in; float and integer ambiguities, and both
//! densities of x out. Also its first epoch without a prior.

use super::inputs::{CaseError, Inputs};
use super::{Report, Source};
use serde_json::{Value, json};
use surefix_core::filter::mixed_integer::{FilterError, Measurement, RecursiveMils};
use surefix_core::linalg::Mat;

/// Room for 16 states, 32 ambiguities, 64 rows.
type Filter = RecursiveMils<f64, 16, 32, 64>;

/// As the file states, relative to the largest entry.
const TOLERANCE: f64 = 1e-8;

impl From<FilterError> for CaseError {
    fn from(error: FilterError) -> Self {
        Self::Absurd(error.to_string())
    }
}

/// Whether a file is of this kind.
pub fn recognises(root: &Value) -> bool {
    root.get("steps").is_some() && root.get("S0").is_some()
}

/// Runs it.
pub fn run(source: &Source, report: &mut Report) {
    if let Err(error) = run_file(Inputs(&source.root), report) {
        report.unreadable("file", error);
    }
}

/// H, G, R and y of a step; G and R may be those of the file.
struct Rows {
    h: (usize, usize, Vec<f64>),
    g: (usize, usize, Vec<f64>),
    r: Vec<f64>,
    y: Vec<f64>,
}

impl Rows {
    fn read(root: Inputs, step: Inputs) -> Result<Self, CaseError> {
        let h = step.matrix("H")?;
        let of = |key| if step.0.get(key).is_some() { step } else { root };
        Ok(Self { g: of("G").matrix("G")?, r: of("R").square_of("R", h.0)?, y: step.list_of("y", h.0)?, h })
    }

    fn measurement(&self) -> Result<Measurement<'_, f64>, CaseError> {
        Ok(Measurement {
            h: Mat::new(&self.h.2, self.h.0, self.h.1, self.h.1)?,
            g: Mat::new(&self.g.2, self.g.0, self.g.1, self.g.1)?,
            r: Mat::square(&self.r, self.h.0)?,
            y: &self.y,
        })
    }
}

fn run_file(root: Inputs, report: &mut Report) -> Result<(), CaseError> {
    let (n, s0) = root.square("S0")?;
    let mut filter = Box::new(Filter::new());
    filter.reset(&root.list_of("m0", n)?, Mat::square(&s0, n)?)?;
    let steps = root.objects("steps")?;
    for (k, step) in steps.iter().enumerate() {
        let id = format!("step {}", k + 1);
        filter.step(&Rows::read(root, *step)?.measurement()?)?;
        let (mean, covariance) = filter.relaxed();
        compare(report, "relaxed.mean", &id, mean, &step.list("m_f")?);
        compare(report, "relaxed.covariance", &id, &entries(covariance), &step.matrix("S_f")?.2);
        let (float, covariance) = filter.float();
        compare(report, "ambiguities.mean", &id, float, &step.list("n_f")?);
        compare(report, "ambiguities.covariance", &id, &entries(covariance), &step.matrix("S_nn")?.2);
        report.compare("integers", &id, &json!(filter.integers()), &json!(step.list("n_I")?), Some(0.0));
        compare(report, "integers.norms", &id, &filter.norms(), &step.list("sqnorms")?);
        let (mean, covariance) = filter.constrained();
        compare(report, "constrained.mean", &id, mean, &step.list("m_c")?);
        compare(report, "constrained.covariance", &id, &entries(covariance), &step.matrix("S_c")?.2);
    }
    if let (Ok(expected), Some(first)) = (root.object("static_mils_epoch1_no_prior"), steps.first()) {
        let id = "without prior";
        filter.start(&Rows::read(root, *first)?.measurement()?)?;
        let (float, covariance) = filter.float();
        compare(report, "static.ambiguities", id, float, &expected.list("n_f")?);
        compare(report, "static.covariance", id, &entries(covariance), &expected.matrix("Psi")?.2);
        report.compare("static.integers", id, &json!(filter.integers()), &json!(expected.list("n_I")?), Some(0.0));
        compare(report, "static.norms", id, &filter.norms(), &expected.list("sqnorms")?);
        let (mean, covariance) = filter.constrained();
        compare(report, "static.x", id, mean, &expected.list("x_hat")?);
        compare(report, "static.x_covariance", id, &entries(covariance), &expected.matrix("Xi")?.2);
    }
    Ok(())
}

fn entries(matrix: Mat<'_, f64>) -> Vec<f64> {
    (0..matrix.rows()).flat_map(|i| matrix.row(i).to_vec()).collect()
}

/// Compares lists as a whole.
fn compare(report: &mut Report, check: &str, id: &str, computed: &[f64], expected: &[f64]) {
    let size = expected.iter().fold(f64::MIN_POSITIVE, |size: f64, value| size.max(value.abs()));
    report.compare(check, id, &json!(computed), &json!(expected), Some(TOLERANCE * size));
}
