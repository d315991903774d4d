//! Files of cases: `{"cases": [{"id", "model", "in": {…}, "out": {name: {"expected", "tol"}}}, …]}`.

use super::inputs::{CaseError, Inputs};
use super::{
    Report, Source, antenna, atmosphere, broadcast_precise, combinations, coordinates, orbits, precise, selection,
    single_point, tides, time,
};
use serde_json::Value;

/// The outputs of a model by name. A refusal to give a value is `null`.
pub struct Outputs {
    values: Vec<(&'static str, Value)>,
    not_at_hand: Vec<(&'static str, CaseError)>,
}

impl<const N: usize> From<[(&'static str, Value); N]> for Outputs {
    fn from(values: [(&'static str, Value); N]) -> Self {
        Self { values: values.into(), not_at_hand: Vec::new() }
    }
}

impl Outputs {
    /// Adds an output.
    pub fn add(&mut self, name: &'static str, value: Value) {
        self.values.push((name, value));
    }

    /// Puts another value in the place of an output's.
    pub fn replace(&mut self, name: &'static str, value: Value) {
        self.values.retain(|(output, _)| *output != name);
        self.add(name, value);
    }

    /// Says that an output cannot be computed for lack of a data file. It takes the place of its value, if it has one.
    pub fn not_at_hand(&mut self, name: &'static str, why: CaseError) {
        self.values.retain(|(output, _)| *output != name);
        self.not_at_hand.push((name, why));
    }
}

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
    ("selection", selection::selection),
    ("sp3", precise::sp3),
    ("clk", precise::clk),
    ("precise", precise::refusal),
    ("broadcast minus precise", broadcast_precise::comparison),
    ("arc", antenna::arc),
    ("pcvinterp", antenna::satellite_variation),
    ("satoff", antenna::satellite_offset),
    ("rcvant", antenna::receiver),
    ("klobuchar", atmosphere::klobuchar),
    ("saast", atmosphere::saastamoinen),
    ("niell", atmosphere::niell),
    ("gmf", atmosphere::gmf),
    ("gpt", atmosphere::gpt),
    ("sunmoon", tides::sun_and_moon),
    ("era", tides::rotation),
    ("tide12", tides::solid_tide),
    ("pole", tides::pole_tide),
    ("ocean", tides::ocean_loading),
    ("gpt3zd", atmosphere::gpt3),
    ("ionex", atmosphere::ionex),
    ("spp", single_point::single_point),
    ("coef", combinations::coefficients),
    ("comb", combinations::combinations),
    ("slip", combinations::slip),
];

/// Models of cases that name none, by an output that only they have.
const MODELS_BY_OUTPUT: &[(&str, &str)] = &[
    ("gpst_minus_utc", "gpst2utc"),
    ("selected_toe_week_toe_tow_iode_health", "selection"),
    ("geoid_undulation", "gpt"),
    ("moon_ecef", "sunmoon"),
    ("up_south_west", "ocean"),
    ("vtec_TECU", "ionex"),
    ("rms_3d_raw", "broadcast minus precise"),
    ("position", "precise"),
    ("clock_linear", "precise"),
];

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
    let Some(name) = case["model"].as_str().or_else(by_output) else {
        let outputs: Vec<&str> = expected.keys().map(String::as_str).collect();
        return report.unknown(&format!("without name, of {}", outputs.join(", ")));
    };
    let Some((_, model)) = MODELS.iter().find(|(known, _)| *known == name) else {
        return report.unknown(name);
    };
    let outputs = match model(context, Inputs(&case["in"])) {
        Ok(outputs) => outputs,
        Err(error @ CaseError::Absent { .. }) => return report.skipped(name, error),
        Err(error) => return report.unreadable(id, error),
    };
    for (output, wanted) in expected {
        let check = format!("{name}.{output}");
        if let Some((_, computed)) = outputs.values.iter().find(|(computed, _)| computed == output) {
            report.compare(&check, id, computed, &wanted["expected"], wanted["tol"].as_f64());
        } else if let Some((_, why)) = outputs.not_at_hand.iter().find(|(absent, _)| absent == output) {
            report.skipped(&check, why);
        } else if !(wanted["tol"].is_null() && wanted["expected"].is_array()) {
            // (A figure that no tolerance is given for is a record of the sources, not a check.)
            report.unknown(&check);
        }
    }
}
