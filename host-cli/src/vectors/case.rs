//! Files of cases: `{"cases": [{"id", "model", "in": {…}, "out": {name: {"expected", "tol"}}}, …]}`.

use super::inputs::{CaseError, Inputs};
use super::{Report, Source, atmosphere, combinations, coordinates, orbits, single_point, time};
use serde_json::Value;

/// The outputs of a model by name.
pub type Outputs = Vec<(&'static str, Value)>;

/// Recomputes a case. Outputs that the file does not ask for may be among them.
type Model = fn(&Context, Inputs) -> Result<Outputs, CaseError>;

/// Every model that can be recomputed.
const MODELS: &[(&str, Model)] = &[
    ("cal2gps", time::calendar_to_gps),
    ("gpst2utc", time::gps_to_utc),
    ("glotime", time::glonass_time),
    ("rinexepoch", time::rinex_epoch),
    ("geo2ecef", coordinates::geodetic_to_ecef),
    ("ecef2geo", coordinates::ecef_to_geodetic),
    ("enu", coordinates::local_frame),
    ("azel", coordinates::sight),
    ("kepler", orbits::kepler),
    ("glonass", orbits::glonass),
    ("klobuchar", atmosphere::klobuchar),
    ("saast", atmosphere::saastamoinen),
    ("niell", atmosphere::niell),
    ("coef", combinations::coefficients),
    ("comb", combinations::combinations),
    ("slip", combinations::slip),
    ("spp", single_point::single_point),
];

/// Outputs that files record without the inputs to recompute them: Doppler and true coordinates of single points.
const RECORDED: &[&str] = &["spp.velocity_ecef", "spp.error_enu_m"];

/// Models of cases that name none, by an output that only they have.
const MODELS_BY_OUTPUT: &[(&str, &str)] =
    &[("gpst_minus_utc", "gpst2utc"), ("selected_toe_week_toe_tow_iode_health", "selection")];

/// What a model may need besides the inputs of its case.
pub struct Context<'a> {
    /// The file that the case is in.
    pub source: &'a Source,
    cases: &'a [Value],
}

impl<'a> Context<'a> {
    /// The inputs of another case of the same file.
    pub fn inputs_of(&self, id: &str) -> Result<Inputs<'a>, CaseError> {
        let case = self.cases.iter().find(|case| case["id"] == id);
        case.map(|case| Inputs(&case["in"])).ok_or_else(|| CaseError::Absurd(format!("no case \"{id}\" in the file")))
    }
}

/// Whether a file has cases of this form.
pub fn recognises(root: &Value) -> bool {
    root["cases"].as_array().and_then(|cases| cases.first()).is_some_and(|case| case["out"].is_object())
}

/// Runs all cases of a file.
pub fn run(source: &Source, report: &mut Report) {
    let cases = source.root["cases"].as_array().map_or(&[][..], Vec::as_slice);
    let context = Context { source, cases };
    for case in cases {
        run_case(&context, case, report);
    }
}

fn run_case(context: &Context, case: &Value, report: &mut Report) {
    let id = case["id"].as_str().unwrap_or("case without id");
    let Some(expected) = case["out"].as_object() else {
        return report.unreadable(id, "no outputs");
    };
    let by_output = || MODELS_BY_OUTPUT.iter().find(|(output, _)| expected.contains_key(*output)).map(|entry| entry.1);
    let name = case["model"].as_str().or_else(by_output).unwrap_or("not named");
    let Some((_, model)) = MODELS.iter().find(|(known, _)| *known == name) else {
        return report.unknown(name);
    };
    let outputs = match model(context, Inputs(&case["in"])) {
        Ok(outputs) => outputs,
        Err(error) => return report.unreadable(id, error),
    };
    for (output, wanted) in expected {
        let check = format!("{name}.{output}");
        match outputs.iter().find(|(computed, _)| computed == output) {
            Some((_, computed)) => report.compare(&check, id, computed, &wanted["expected"], wanted["tol"].as_f64()),
            None if RECORDED.contains(&check.as_str()) => report.recorded(&check),
            None => report.unknown(&check),
        }
    }
}
