//! What came of running a vector file: one line per check, with its tolerance and worst deviation.

use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt;

/// One output of one model, over all cases.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Check {
    /// Cases compared.
    pub cases: usize,
    /// Cases beyond their tolerance.
    pub failed: usize,
    /// The case that comes closest to its tolerance, or exceeds it most.
    pub worst: Option<Worst>,
}

/// The worst case of a check.
#[derive(Clone, Debug, PartialEq)]
pub struct Worst {
    /// The case's name.
    pub case: String,
    /// Greatest absolute difference between expected and computed; infinite where they cannot be compared.
    pub deviation: f64,
    /// Tolerance of this case; `None` where any finite number will do.
    pub tolerance: Option<f64>,
}

impl Worst {
    /// Whether the deviation exceeds the tolerance.
    fn fails(&self) -> bool {
        // NaN fails.
        !self.tolerance.map_or(self.deviation.is_finite(), |tolerance| self.deviation <= tolerance)
    }

    /// Deviation in units of the tolerance.
    fn severity(&self) -> f64 {
        match self.tolerance {
            _ if self.fails() => f64::INFINITY,
            Some(tolerance) if tolerance > 0.0 => self.deviation / tolerance,
            _ => 0.0,
        }
    }
}

/// What came of a vector file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    checks: BTreeMap<String, Check>,
    unknown: BTreeMap<String, usize>,
    recorded: BTreeMap<String, usize>,
    unreadable: Vec<String>,
}

impl Report {
    /// Compares a computed with an expected value under the name of a check.
    ///
    /// Numbers and nested lists of numbers are compared by absolute difference; a tolerance of `None` asks for finite
    /// numbers only. Booleans and strings must be equal. A computed `null` is a refusal, which `"refuse"` and `"none"`
    /// ask for.
    pub fn compare(&mut self, check: &str, case: &str, computed: &Value, expected: &Value, tolerance: Option<f64>) {
        let deviation = deviation(computed, expected).unwrap_or(f64::INFINITY);
        let worst = Worst { case: case.to_owned(), deviation, tolerance };
        let entry = self.checks.entry(check.to_owned()).or_default();
        entry.cases += 1;
        entry.failed += usize::from(worst.fails());
        let is_worse = |held: &Worst| (worst.severity(), deviation) > (held.severity(), held.deviation);
        if entry.worst.as_ref().is_none_or(is_worse) {
            entry.worst = Some(worst);
        }
    }

    /// Counts a case of a model that this version does not know.
    pub fn unknown(&mut self, model: &str) {
        *self.unknown.entry(model.to_owned()).or_default() += 1;
    }

    /// Notes an output that the file has no inputs for; it counts neither way.
    pub fn recorded(&mut self, check: &str) {
        *self.recorded.entry(check.to_owned()).or_default() += 1;
    }

    /// Notes a case that could not be recomputed, and why.
    pub fn unreadable(&mut self, case: &str, why: impl fmt::Display) {
        self.unreadable.push(format!("{case}: {why}"));
    }

    /// The checks by name.
    pub fn checks(&self) -> &BTreeMap<String, Check> {
        &self.checks
    }

    /// Unknown models with the number of their cases.
    pub fn unknown_models(&self) -> &BTreeMap<String, usize> {
        &self.unknown
    }

    /// Whether there were checks and all passed.
    pub fn passed(&self) -> bool {
        let all = self.checks.values().all(|check| check.failed == 0);
        !self.checks.is_empty() && all && self.unknown.is_empty() && self.unreadable.is_empty()
    }
}

/// Greatest absolute difference; `None` where the values are of different shape, or not equal and not numbers.
fn deviation(computed: &Value, expected: &Value) -> Option<f64> {
    match (computed, expected) {
        (Value::Number(a), Value::Number(b)) => Some((a.as_f64()? - b.as_f64()?).abs()),
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            a.iter().zip(b).try_fold(0.0_f64, |worst, (a, b)| Some(worst.max(deviation(a, b)?)))
        }
        (Value::Null, Value::String(refusal)) => (refusal == "refuse" || refusal == "none").then_some(0.0),
        (a, b) => (a == b).then_some(0.0),
    }
}

impl fmt::Display for Report {
    /// A table; failing lines say FAIL and in how many cases.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = self.checks.keys().map(String::len).max().unwrap_or(0).max("check".len());
        if !self.checks.is_empty() {
            writeln!(f, "  {:width$}  cases  tolerance  deviation  result  worst case", "check")?;
        }
        for (name, check) in &self.checks {
            let Some(worst) = &check.worst else { continue };
            let tolerance = worst.tolerance.map_or("-".to_owned(), |t| format!("{t:.1e}"));
            let result = if check.failed == 0 { "pass" } else { "FAIL" };
            write!(f, "  {name:width$}  {:5}  {tolerance:>9}  {:9.1e}  ", check.cases, worst.deviation)?;
            write!(f, "{result:6}  {}", worst.case)?;
            match check.failed {
                0 => writeln!(f)?,
                failed => writeln!(f, " ({failed} of {} failed)", check.cases)?,
            }
        }
        for (name, cases) in &self.recorded {
            writeln!(f, "  not checked: {name} ({cases} cases), its inputs are not in the file")?;
        }
        for (model, cases) in &self.unknown {
            writeln!(f, "  unknown model: {model} ({cases} cases) FAIL")?;
        }
        for line in self.unreadable.iter().take(SHOWN) {
            writeln!(f, "  not run: {line} FAIL")?;
        }
        if self.unreadable.len() > SHOWN {
            writeln!(f, "  not run: {} more FAIL", self.unreadable.len() - SHOWN)?;
        }
        Ok(())
    }
}

/// Cases that could not be run are listed up to this number.
const SHOWN: usize = 3;

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn passes(computed: Value, expected: Value, tolerance: Option<f64>) -> bool {
        let mut report = Report::default();
        report.compare("check", "case", &computed, &expected, tolerance);
        report.passed()
    }

    #[test]
    fn values_are_compared_by_kind() {
        assert!(passes(json!([1.0, [2.0]]), json!([1, [2.05]]), Some(0.1)));
        assert!(!passes(json!([1.0, [2.0]]), json!([1, [2.15]]), Some(0.1)));
        assert!(!passes(json!([1.0]), json!([1.0, 2.0]), Some(0.1)));
        assert!(passes(json!(7.0), json!(0.0), None) && !passes(json!(f64::NAN), json!(0.0), None));
        assert!(passes(json!(true), json!(true), None) && !passes(json!(false), json!(true), None));
        assert!(passes(Value::Null, json!("refuse"), None) && !passes(json!(1.0), json!("none"), None));
        assert!(!passes(Value::Null, json!(1.0), Some(1e9)));
    }

    #[test]
    fn what_was_not_run_does_not_pass() {
        let mut report = Report::default();
        assert!(!report.passed());
        report.compare("check", "case", &json!(1), &json!(1), Some(0.0));
        assert!(report.passed());
        report.unknown("crystal ball");
        assert!(!report.passed() && report.to_string().contains("unknown model: crystal ball (1 cases)"));
    }

    #[test]
    fn the_worst_case_is_the_one_nearest_its_tolerance() {
        let mut report = Report::default();
        report.compare("check", "loose", &json!(0.5), &json!(0.0), Some(1.0));
        report.compare("check", "tight", &json!(0.09), &json!(0.0), Some(0.1));
        assert_eq!(report.checks()["check"].worst.as_ref().unwrap().case, "tight");
    }
}
