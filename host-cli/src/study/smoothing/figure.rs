//! Figs. 2, 3 and 4 of the paper.

use super::adaptation::{Learning, Reading};
use super::trial::{Posterior, Scheme};
use super::{Adaptation, Table};
use crate::plot::panel::{Frame, Panel, Range};
use crate::plot::{Anchor, BLACK, BLUE, Color, Drawing, GREEN, ORANGE, RED};

const WIDTH: u32 = 900;
const LEFT: f64 = 70.0;
const PANEL_WIDTH: f64 = 810.0;
const PANEL_HEIGHT: f64 = 240.0;
const TOP: f64 = 60.0;
const PITCH: f64 = 290.0;

/// A line through values over their index.
struct Series<'a> {
    name: &'a str,
    color: Color,
    width: f64,
    values: Vec<f64>,
}

/// Fig. 2: RMSE and RAPC in time, one panel for each model, logarithmic. Integers and estimate from the same posterior, as
/// the paper's rows, with the spherical-radial rule if it was run.
pub fn errors_in_time(table: &Table) -> Drawing {
    let scheme = table.rows.iter().map(|row| row.scheme).max_by_key(|&scheme| scheme as usize).unwrap_or(Scheme::Erts);
    let rows: Vec<_> = table.rows.iter().filter(|row| row.scheme == scheme).collect();
    let mut drawing = Drawing::new(WIDTH, (TOP + PITCH * rows.len() as f64 + 20.0) as u32);
    heading(&mut drawing, &format!("RMSE (solid) and RAPC (pale) of the fixed position, {}", scheme.name()));
    for (k, row) in rows.iter().enumerate() {
        let of = |posterior: Posterior, rapc: bool| {
            let outcome = row.outcome(posterior, posterior);
            let values = if rapc { &outcome.rapc } else { &outcome.rmse };
            values.iter().map(|value| value.log10()).collect()
        };
        let series = [
            Series { name: "", color: ORANGE, width: 2.5, values: of(Posterior::Filter, true) },
            Series { name: "", color: GREEN, width: 2.5, values: of(Posterior::Smoother, true) },
            Series { name: "filter", color: RED, width: 1.0, values: of(Posterior::Filter, false) },
            Series { name: "smoother", color: BLUE, width: 1.0, values: of(Posterior::Smoother, false) },
        ];
        panel(&mut drawing, frame(k), &format!("{}: lg RMSE, lg RAPC [m]", row.differences.name()), &series);
    }
    footer(&mut drawing, "epoch");
    drawing
}

/// Fig. 3: RMSE and RAPC of (A) to (D) in time, one panel for each reading of the start.
pub fn adaptation_in_time(adaptation: &Adaptation) -> Drawing {
    let mut drawing = Drawing::new(WIDTH, (TOP + 2.0 * PITCH + 20.0) as u32);
    heading(
        &mut drawing,
        "RMSE (thin) and RAPC (thick): (A) RTSAP, wrong noise; (B) APP; (C) RTSAP, true noise; (D) APP, fixed",
    );
    for reading in Reading::ALL {
        let [start, learned, recommended] = &adaptation.cases[reading as usize];
        let truth = &adaptation.truth;
        let cases = [("(A)", RED, start), ("(B)", BLUE, learned), ("(C)", GREEN, truth), ("(D)", ORANGE, recommended)];
        let mut series = Vec::new();
        for (name, color, case) in cases {
            let [rmse, rapc] = &case.series;
            series.push(Series { name, color, width: 0.7, values: rmse.iter().map(|value| value.log10()).collect() });
            series.push(Series {
                name: "",
                color,
                width: 2.5,
                values: rapc.iter().map(|value| value.log10()).collect(),
            });
        }
        let title = format!("{} reading: lg RMSE, lg RAPC [m]", reading.name());
        panel(&mut drawing, frame(reading as usize), &title, &series);
    }
    footer(&mut drawing, "epoch");
    drawing
}

/// Fig. 4: Q(θⁱ, θⁱ⁻¹) and −ln p(y | θⁱ), less their last values, over the iterations, for each run and both readings.
pub fn convergence(adaptation: &Adaptation) -> Drawing {
    let mut drawing = Drawing::new(WIDTH, (TOP + 4.0 * PITCH + 20.0) as u32);
    heading(&mut drawing, "EM: objective and likelihood over iterations, each run less its last value");
    type Quantity = fn(&Learning) -> &[f64];
    let quantities: [(&str, Quantity); 2] =
        [("Q(i, i-1)", |run| &run.objective), ("-ln p(y)", |run| &run.negative_log_likelihood)];
    for reading in Reading::ALL {
        for (k, (quantity, of)) in quantities.into_iter().enumerate() {
            let of_run = |run: &super::Adapted| {
                let values = of(&run.learning[reading as usize]);
                let last = values.last().copied().unwrap_or(0.0);
                values.iter().map(|value| value - last).collect()
            };
            let color = if k == 0 { RED } else { BLUE };
            let series: Vec<Series<'_>> =
                adaptation.runs.iter().map(|run| Series { name: "", color, width: 1.2, values: of_run(run) }).collect();
            let title = format!("{} reading: {quantity}", reading.name());
            panel(&mut drawing, frame(2 * reading as usize + k), &title, &series);
        }
    }
    footer(&mut drawing, "iteration");
    drawing
}

fn frame(k: usize) -> Frame {
    Frame { left: LEFT, top: TOP + PITCH * k as f64, width: PANEL_WIDTH, height: PANEL_HEIGHT }
}

fn heading(drawing: &mut Drawing, text: &str) {
    drawing.text((f64::from(WIDTH) / 2.0, 18.0), Anchor::Middle, text, BLACK);
}

fn footer(drawing: &mut Drawing, text: &str) {
    let bottom = f64::from(drawing.height) - 14.0;
    drawing.text((LEFT + PANEL_WIDTH / 2.0, bottom), Anchor::Middle, text, BLACK);
}

/// Series over their index, with a range that holds them all.
fn panel(drawing: &mut Drawing, frame: Frame, title: &str, series: &[Series<'_>]) {
    let longest = series.iter().map(|series| series.values.len()).max().unwrap_or(0);
    let finite = || series.iter().flat_map(|series| &series.values).copied().filter(|value| value.is_finite());
    let (low, high) = (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max));
    let air = if high > low { 0.05 * (high - low) } else { 1.0 };
    let (x, y) = match low.is_finite() {
        true => (Range { low: 0.0, high: longest.max(2) as f64 - 1.0 }, Range { low: low - air, high: high + air }),
        false => (Range { low: 0.0, high: 1.0 }, Range { low: 0.0, high: 1.0 }),
    };
    let mut panel = Panel::new(drawing, frame, x, y, title, true);
    for series in series {
        let points: Vec<_> = series.values.iter().enumerate().map(|(k, &value)| (k as f64, value)).collect();
        panel.line(&points, series.color, series.width);
    }
    let named = series.iter().filter(|series| !series.name.is_empty());
    panel.finish(&named.map(|series| (series.name, series.color)).collect::<Vec<_>>());
}
