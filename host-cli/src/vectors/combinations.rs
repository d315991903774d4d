//! Linear combinations of two signals, and cycle slips in them.

use super::case::{Context, Outputs};
use super::inputs::{CaseError, Inputs};
use serde_json::json;
use surefix_core::model::combination::FrequencyPair;

fn pair(inputs: Inputs) -> Result<FrequencyPair, CaseError> {
    let pair = FrequencyPair::new(inputs.number("f1_hz")?, inputs.number("f2_hz")?);
    pair.ok_or_else(|| CaseError::Absurd("no two different frequencies".to_owned()))
}

/// Wavelengths and coefficients.
pub fn coefficients(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let pair = pair(inputs)?;
    let [alpha, beta] = pair.ionosphere_free_coefficients();
    let [lambda1, lambda2] = pair.wavelengths();
    Ok(vec![
        ("if_alpha", json!(alpha)),
        ("if_beta", json!(beta)),
        ("wavelength_1", json!(lambda1)),
        ("wavelength_2", json!(lambda2)),
        ("widelane_wavelength", json!(pair.wide_lane_wavelength())),
        ("narrowlane_wavelength", json!(pair.narrow_lane_wavelength())),
        ("if_noise_factor", json!(pair.ionosphere_free_noise())),
        ("mu_iono_ratio_f1sq_f2sq", json!(pair.ionosphere_ratio())),
    ])
}

/// Combinations of one epoch.
pub fn combinations(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let pair = pair(inputs)?;
    let codes = [inputs.number("P1")?, inputs.number("P2")?];
    let cycles = [inputs.number("L1_cycles")?, inputs.number("L2_cycles")?];
    Ok(vec![
        ("iono_free_code", json!(pair.ionosphere_free(codes))),
        ("iono_free_phase_m", json!(pair.ionosphere_free(pair.metres(cycles)))),
        ("melbourne_wubbena_m", json!(pair.melbourne_wubbena(cycles, codes))),
        ("melbourne_wubbena_cycles", json!(pair.melbourne_wubbena_cycles(cycles, codes))),
        ("geometry_free_phase_m", json!(pair.geometry_free(cycles))),
        ("geometry_free_code_m", json!(pair.geometry_free_code(codes))),
    ])
}

/// A step of the Melbourne–Wübbena combination that tells a slip `[cycles]`.
const WIDE_LANE_STEP: f64 = 0.5;
/// A third difference of the geometry-free phase that tells a slip `[m]`, at 30 s.
const GEOMETRY_FREE_STEP: f64 = 0.05;

/// An arc into which a slip was injected: what the combinations see of it.
pub fn slip(context: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let pair = pair(inputs)?;
    let rows: Vec<[f64; 5]> = match inputs.text("rows_of") {
        Ok(other) => context.inputs_of(other)?,
        Err(_) => inputs,
    }
    .rows("rows_tow_P1_P2_L1_L2")?;
    let from = inputs.integer("slip_from_index")? as usize;
    if from < 3 || from >= rows.len() {
        return Err(CaseError::Absurd(format!("slip at row {from} of {}", rows.len())));
    }
    let slip: [f64; 2] = inputs.numbers("slip_cycles")?;
    let slipped = |row: usize, n: [f64; 2]| if row < from { n } else { [n[0] + slip[0], n[1] + slip[1]] };
    let arc = || rows.iter().enumerate().map(|(row, &[_, p1, p2, l1, l2])| (slipped(row, [l1, l2]), [p1, p2]));

    let wide_lane: Vec<f64> = arc().map(|(cycles, codes)| pair.melbourne_wubbena_cycles(cycles, codes)).collect();
    let geometry_free: Vec<f64> = arc().map(|(cycles, _)| pair.geometry_free(cycles)).collect();
    let (before, after) = wide_lane.split_at(from);
    let mean_before = mean(before);
    let variance = before.iter().map(|x| (x - mean_before).powi(2)).sum::<f64>() / (before.len() - 1) as f64;
    let step = mean(after) - mean_before;
    let at = |back: usize| geometry_free[from - back];
    let third_difference = at(0) - 3.0 * at(1) + 3.0 * at(2) - at(3);
    Ok(vec![
        ("gf_third_difference_at_slip_m", json!(third_difference)),
        ("gf_step_expected_m", json!(pair.geometry_free(slip))),
        ("mw_mean_before_cycles", json!(mean_before)),
        ("mw_std_before_cycles", json!(variance.sqrt())),
        ("mw_step_estimate_cycles", json!(step)),
        ("mw_step_expected_cycles", json!(step.round())),
        ("slip_present", json!(step.abs() > WIDE_LANE_STEP || third_difference.abs() > GEOMETRY_FREE_STEP)),
    ])
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
