//! Fig. 1 of the paper: errors of one run over time.
//!
//! Three panels for the position (east, north, up), each with the relaxed density in blue, the constrained one in red and
//! their 2σ intervals; one for the ambiguities, real-valued in blue, integers in red, and a mark below for each true jump.

use super::scenario::AMBIGUITIES;
use super::trial::{Position, Snapshot};
use crate::plot::panel::{Frame, Panel, Range};
use crate::plot::{Anchor, BLACK, BLUE, Drawing, RED};

/// One of the two densities.
type Density = fn(&Snapshot) -> &Position;

const WIDTH: u32 = 900;
const HEIGHT: u32 = 860;
const LEFT: f64 = 60.0;
const PANEL_WIDTH: f64 = 820.0;
const PANEL_HEIGHT: f64 = 150.0;
const PITCH: f64 = 195.0;
const TOP: f64 = 60.0;

/// Draws the epochs of one run.
pub fn draw(track: &[Snapshot], seed: u64) -> Drawing {
    let mut drawing = Drawing::new(WIDTH, HEIGHT);
    let after: Vec<&Snapshot> = track.iter().filter(|snapshot| !snapshot.transient).collect();
    let wrong = after.iter().filter(|snapshot| snapshot.wrong() > 0).count();
    let slips = after.iter().flat_map(|snapshot| snapshot.jumps).filter(|&jump| jump != 0).count();
    let caption = format!(
        "MI-LRKF, cubature, seed {seed}: {slips} cycle slips, {wrong} of {} epochs with a wrong integer",
        after.len()
    );
    drawing.text((f64::from(WIDTH) / 2.0, 18.0), Anchor::Middle, caption, BLACK);

    let end = track.last().map_or(1.0, |snapshot| snapshot.time);
    let time = Range { low: 0.0, high: end };
    let frame = |k: usize| Frame { left: LEFT, top: TOP + PITCH * k as f64, width: PANEL_WIDTH, height: PANEL_HEIGHT };
    let largest = after
        .iter()
        .flat_map(|snapshot| [snapshot.relaxed.error.amax(), 2.0 * snapshot.relaxed.covariance.diagonal().max().sqrt()])
        .fold(0.05, f64::max);
    let range = symmetric(largest);
    for (axis, name) in ["east", "north", "up"].into_iter().enumerate() {
        let title = format!("error {name} [m]");
        let mut panel = Panel::new(&mut drawing, frame(axis), time, range, &title, false);
        let densities: [(Density, _, _); 2] =
            [(|snapshot| &snapshot.relaxed, BLUE, 0.15), (|snapshot| &snapshot.constrained, RED, 0.25)];
        for (position, color, opacity) in densities {
            let two_sigma = |snapshot: &Snapshot| 2.0 * position(snapshot).covariance[(axis, axis)].sqrt();
            panel.band(&over_time(track, two_sigma), color, opacity);
            panel.line(&over_time(track, |snapshot| position(snapshot).error[axis]), color, 1.2);
        }
        panel.finish(&[("relaxed", BLUE), ("constrained", RED), ("(bands: 2 sigma)", BLACK)]);
    }

    let largest = after
        .iter()
        .flat_map(|snapshot| snapshot.float_errors.into_iter().chain(snapshot.integer_errors.map(|error| error as f64)))
        .fold(1.0_f64, |largest, error| largest.max(error.abs()));
    let range = symmetric(largest);
    let mut panel = Panel::new(&mut drawing, frame(3), time, range, "error of ambiguities [cycles]", true);
    for i in 0..AMBIGUITIES {
        panel.line(&over_time(track, |snapshot| snapshot.float_errors[i]), BLUE, 0.8);
    }
    for i in 0..AMBIGUITIES {
        panel.steps(&over_time(track, |snapshot| snapshot.integer_errors[i] as f64), RED, 1.4);
    }
    for snapshot in track.iter().filter(|snapshot| snapshot.jumps.iter().any(|&jump| jump != 0)) {
        panel.line(&[(snapshot.time, range.low), (snapshot.time, 0.9 * range.low)], BLACK, 2.0);
    }
    panel.finish(&[("real-valued", BLUE), ("integers", RED), ("true slips, below", BLACK)]);
    drawing.text((LEFT + PANEL_WIDTH / 2.0, f64::from(HEIGHT) - 20.0), Anchor::Middle, "time [s]", BLACK);
    drawing
}

/// A range about zero with some air.
fn symmetric(largest: f64) -> Range {
    Range { low: -1.1 * largest, high: 1.1 * largest }
}

fn over_time(track: &[Snapshot], value: impl Fn(&Snapshot) -> f64) -> Vec<(f64, f64)> {
    track.iter().map(|snapshot| (snapshot.time, value(snapshot))).collect()
}
