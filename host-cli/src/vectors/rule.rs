//! Linearisation rules as vector files name them: `"ckf"`, `"ut_1_2_1"`, `"gh3"`, `["ukf", 1, 2, 1]`, `["gh", 3]`.

use super::inputs::CaseError;
use serde_json::Value;
use surefix_core::filter::linearize::Rule;

/// Reads the name of a rule.
pub fn read(name: &Value) -> Result<Rule, CaseError> {
    let unknown = || CaseError::Absurd(format!("no rule {name}"));
    // One form for all: a kind and its numbers.
    let (kind, numbers): (String, Vec<f64>) = match name {
        Value::String(text) => {
            let mut parts = text.split('_');
            let first = parts.next().unwrap_or_default();
            let kind = first.trim_end_matches(|c: char| c.is_ascii_digit());
            let numbers = std::iter::once(&first[kind.len()..]).chain(parts).filter(|part| !part.is_empty());
            (kind.to_owned(), numbers.map(str::parse).collect::<Result<_, _>>().map_err(|_| unknown())?)
        }
        Value::Array(parts) => {
            let (kind, numbers) = parts.split_first().ok_or_else(unknown)?;
            let kind = kind.as_str().ok_or_else(unknown)?.to_owned();
            (kind, numbers.iter().map(Value::as_f64).collect::<Option<_>>().ok_or_else(unknown)?)
        }
        _ => return Err(unknown()),
    };
    match (kind.as_str(), numbers.as_slice()) {
        ("ekf", []) => Ok(Rule::Taylor),
        ("ckf", []) => Ok(Rule::Cubature),
        ("ut" | "ukf", &[alpha, beta, kappa]) => Ok(Rule::Unscented { alpha, beta, kappa }),
        ("gh", &[order]) => Ok(Rule::GaussHermite { order: order as usize }),
        _ => Err(unknown()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn both_spellings_are_read() {
        for name in [json!("ut_0.5_2_0"), json!(["ukf", 0.5, 2.0, 0])] {
            assert_eq!(read(&name), Ok(Rule::Unscented { alpha: 0.5, beta: 2.0, kappa: 0.0 }));
        }
        assert_eq!(read(&json!("gh3")), read(&json!(["gh", 3])));
        assert_eq!((read(&json!("ekf")), read(&json!(["ckf"]))), (Ok(Rule::Taylor), Ok(Rule::Cubature)));
        for unknown in [json!("ut_1_2"), json!("gh"), json!(7), json!([]), json!("ekf_x")] {
            assert!(read(&unknown).is_err(), "{unknown}");
        }
    }
}
