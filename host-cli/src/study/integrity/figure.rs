//! Figs. 4 and 10 to 12 of the paper; 13 to 15 are Stanford diagrams. Fig. 16 is that of the recommended filter.

use super::Table;
use super::bounds::Bounds;
use super::scenario::TRANSIENT;
use super::trial::{Run, Sample};
use super::variant::{PAPERS, RECOMMENDED};
use crate::compare::stanford::Stanford;
use crate::plot::panel::{Frame, Panel, Range};
use crate::plot::{Anchor, BLACK, BLUE, Color, Drawing, GREEN, ORANGE, RED};

const WIDTH: u32 = 900;
const PANEL: f64 = 200.0;
const PITCH: f64 = 250.0;
/// Alert limits of the diagrams, horizontal and vertical `[m]`.
const ALERT_LIMITS: [f64; 2] = [1.0, 2.0];

/// The runs that are drawn, with their colours: the paper's blue, green and red, and orange.
fn drawn(table: &Table) -> Vec<(&'static str, Color, &Run)> {
    let names = PAPERS.iter().copied().chain([(RECOMMENDED, RECOMMENDED)]);
    let colored = names.zip([BLUE, GREEN, RED, ORANGE]);
    colored.filter_map(|((name, of), color)| Some((name, color, table.first(of)?))).collect()
}

fn frame(k: usize) -> Frame {
    Frame { left: 70.0, top: 60.0 + PITCH * k as f64, width: 810.0, height: PANEL }
}

fn drawing(panels: usize, title: &str) -> Drawing {
    let mut drawing = Drawing::new(WIDTH, (60.0 + PITCH * panels as f64) as u32);
    drawing.text((70.0, 20.0), Anchor::Start, title, BLACK);
    drawing
}

/// A panel over time with a line for each run.
fn over_time(
    drawing: &mut Drawing,
    k: usize,
    title: &str,
    y: Range,
    series: &[(&str, Color, &Run)],
    value: impl Fn(&Sample) -> f64,
) {
    let longest = series.iter().map(|(_, _, run)| run.samples.len()).max().unwrap_or(1);
    let x = Range { low: TRANSIENT as f64, high: (TRANSIENT + longest) as f64 };
    let mut panel = Panel::new(drawing, frame(k), x, y, title, true);
    for (_, color, run) in series {
        let point = |(i, sample): (usize, &Sample)| ((TRANSIENT + i) as f64, value(sample));
        panel.line(&run.samples.iter().enumerate().map(point).collect::<Vec<_>>(), *color, 1.0);
    }
    panel.finish(&series.iter().map(|(name, color, _)| (*name, *color)).collect::<Vec<_>>());
}

/// Fig. 4.
pub fn success_rates(bounds: &Bounds) -> Drawing {
    let mut drawing = drawing(1, "Success rates over lg F: simulated (thick), bounds (thin)");
    let ends = |k: usize| bounds.rows.get(k).map_or(0.0, |row| row[0].log10());
    let x = Range { low: ends(0), high: ends(bounds.rows.len().saturating_sub(1)) };
    let mut panel = Panel::new(&mut drawing, frame(0), x, Range { low: 0.0, high: 1.0 }, "success rate", true);
    let mut line = |column: usize, color: Color, width: f64| {
        panel.line(&bounds.rows.iter().map(|row| (row[0].log10(), row[column])).collect::<Vec<_>>(), color, width);
    };
    for (column, color, width) in [
        (1, BLACK, 2.5),
        (2, GREEN, 2.5),
        (3, ORANGE, 2.5),
        (4, GREEN, 1.0),
        (5, BLUE, 1.0),
        (6, BLUE, 1.0),
        (7, RED, 1.0),
        (8, RED, 1.0),
        (9, ORANGE, 1.0),
    ] {
        line(column, color, width);
    }
    panel.finish(&[("ILS", BLACK), ("IB", GREEN), ("ADOP", BLUE), ("slabs, ball", RED), ("IR", ORANGE)]);
    drawing
}

/// Fig. 10: failure rate of all ambiguities, logarithmic, as success rates near 1 are lines on the edge.
pub fn success(table: &Table) -> Drawing {
    let mut drawing = drawing(1, &format!("lg (1 - success rate) of all ambiguities, noise: {}", table.noise.name()));
    let y = Range { low: -12.0, high: 0.0 };
    over_time(&mut drawing, 0, "lg (1 - P_s)", y, &drawn(table), |sample| (1.0 - sample.success).max(1e-12).log10());
    drawing
}

/// Fig. 11: errors east, north, up.
pub fn errors(table: &Table) -> Drawing {
    let mut drawing = drawing(3, &format!("errors [m], noise: {}", table.noise.name()));
    for (k, title) in ["east [m]", "north [m]", "up [m]"].into_iter().enumerate() {
        over_time(&mut drawing, k, title, Range { low: -1.0, high: 1.0 }, &drawn(table), |sample| sample.error[k]);
    }
    drawing
}

/// Fig. 12: errors and protection levels, logarithmic: the error of the KF in black, levels in colour.
pub fn levels(table: &Table) -> Drawing {
    let mut drawing = drawing(2, &format!("lg of errors (black) and levels [m], noise: {}", table.noise.name()));
    let y = Range { low: -3.0, high: 1.5 };
    for (k, title) in ["lg HPL [m]", "lg VPL [m]"].into_iter().enumerate() {
        let runs = drawn(table);
        over_time(&mut drawing, k, title, y, &runs, |sample| sample.levels[k].log10());
        let plain: Vec<_> = runs.iter().take(1).map(|(_, _, run)| ("", BLACK, *run)).collect();
        let error = |sample: &Sample| [sample.error.xy().norm(), sample.error.z.abs()][k].max(1e-3).log10();
        over_time(&mut drawing, k, "", y, &plain, error);
    }
    drawing
}

/// Figs. 13 to 15.
pub fn stanford(run: &Run) -> Option<Stanford> {
    Stanford::of_errors(run.samples.iter().map(|sample| (sample.error, sample.levels)), ALERT_LIMITS)
}
