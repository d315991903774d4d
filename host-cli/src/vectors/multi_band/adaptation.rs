//! Steps of EM on the measurements of a file beside this one, with the flags of a first pass.

use super::smoothing::{model, neighbour};
use super::{CaseError, Inputs, Report, Source, note, root};
use crate::vectors::expectation;
use serde_json::Value;
use surefix_core::filter::linearize::Rule;

/// Whether a file is of this kind.
pub fn recognises(root: &Value) -> bool {
    root.get("flags").is_some() && root.get("steps").is_some()
}

/// Runs it.
pub fn run(source: &Source, report: &mut Report) {
    let outcome = check(source, report);
    note("adaptation", outcome, report);
}

fn check(source: &Source, report: &mut Report) -> Result<(), CaseError> {
    let file = root(source);
    let name = file.text("note")?.split([' ', ';']).find(|word| word.ends_with(".json"));
    let name = name.ok_or_else(|| CaseError::Absurd("the note names no file of inputs".to_owned()))?;
    let inputs = neighbour(source, name)?;
    let mut model = model(&Inputs(&inputs), Rule::Taylor)?;
    let (_, ambiguities, flags) = file.matrix("flags")?;
    let flags: Vec<Vec<bool>> =
        flags.chunks(ambiguities).map(|step| step.iter().map(|&o| o != 0.0).collect()).collect();
    model.set_flags(&flags);
    expectation::steps(&mut model, file, report)
}
