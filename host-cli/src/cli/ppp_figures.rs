//! Plots of precise point positioning: residuals over elevation (Figs. 3 and 4 of Zhang 2020), convergence (Fig. 5), learned noise over
//! elevation, likelihood (Fig. 7).

use crate::plot::panel::{Frame, Panel, Range};
use crate::plot::{Anchor, BLACK, BLUE, Color, Drawing, GREEN, ORANGE, RED};
use crate::process::ppp::run::Run;
use crate::smooth::ppp::Smoothed;
use crate::smooth::ppp::tape::Kind as TapeKind;
use std::collections::BTreeMap;
use surefix_core::gnss::geodesy::Geodetic;
use surefix_core::gnss::satellite::Constellation;
use surefix_core::gnss::solution::Quality;
use surefix_core::ppp::link::Kind;

const WIDTH: u32 = 900;
const PITCH: f64 = 250.0;
/// Dots of a plot, at most.
const DOTS: usize = 6000;
/// Colours of constellations by their index.
const COLORS: [Color; 5] = [BLUE, GREEN, ORANGE, Color(130, 80, 160), RED];

/// Name and drawing of each plot.
pub fn all(run: &Run, smoothed: Option<&Smoothed>) -> Vec<(&'static str, Drawing)> {
    let mut drawings = vec![("residuals", residuals(run, smoothed)), ("convergence", convergence(run))];
    if let Some(smoothed) = smoothed {
        drawings.push(("noise", noise(smoothed)));
        drawings.push(("likelihood", likelihood(smoothed)));
    }
    drawings
}

fn drawing(panels: usize, title: &str) -> Drawing {
    let mut drawing = Drawing::new(WIDTH, (60.0 + PITCH * panels as f64) as u32);
    drawing.text((70.0, 20.0), Anchor::Start, title, BLACK);
    drawing
}

fn frame(k: usize) -> Frame {
    Frame { left: 70.0, top: 60.0 + PITCH * k as f64, width: 810.0, height: 200.0 }
}

/// A small cross for each point.
fn dots(panel: &mut Panel<'_>, points: &[(f64, f64)], size: (f64, f64), color: Color) {
    let every = points.len().div_ceil(DOTS).max(1);
    for &(x, y) in points.iter().step_by(every) {
        panel.line(&[(x - size.0, y), (x + size.0, y)], color, 1.0);
    }
}

/// Elevation `[deg]`, residual and standard deviation `[m]` of a constellation.
type Points = BTreeMap<Constellation, Vec<(f64, f64, f64)>>;

fn points(run: &Run, smoothed: Option<&Smoothed>, phase: bool) -> Points {
    let mut points = Points::new();
    match smoothed {
        Some(smoothed) => {
            for (i, row) in smoothed.tape.rows.iter().enumerate() {
                if (row.kind == TapeKind::Phase) == phase {
                    let point = (row.elevation.to_degrees(), smoothed.residuals[i], smoothed.variances[i].sqrt());
                    points.entry(row.satellite.constellation()).or_default().push(point);
                }
            }
        }
        None => {
            for residual in run.residuals.iter().filter(|residual| !residual.rejected) {
                if (residual.kind == Kind::Phase) == phase {
                    let elevation = f64::from(residual.elevation).to_degrees();
                    let point = (elevation, f64::from(residual.postfit), f64::from(residual.sigma));
                    points.entry(residual.satellite.constellation()).or_default().push(point);
                }
            }
        }
    }
    points
}

/// Largest of what 99 % of the values are below, at least a little.
fn bound(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.filter(|value| value.is_finite()).map(f64::abs).collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() * 99 / 100).copied().unwrap_or(1.0).max(1e-4)
}

const ELEVATIONS: Range = Range { low: 0.0, high: 90.0 };

fn residuals(run: &Run, smoothed: Option<&Smoothed>) -> Drawing {
    let mut drawing = drawing(4, "residuals (dots) and their standard deviations over elevation [deg]");
    for (k, (title, phase)) in [("code [m]", false), ("phase [m]", true)].into_iter().enumerate() {
        let points = points(run, smoothed, phase);
        let high = bound(points.values().flatten().map(|point| point.1)) * 1.2;
        let legend: Vec<(String, Color)> = points.keys().map(|c| (c.letter().to_string(), COLORS[c.index()])).collect();
        let legend: Vec<(&str, Color)> = legend.iter().map(|(name, color)| (name.as_str(), *color)).collect();
        let y = Range { low: -high, high };
        let mut panel = Panel::new(&mut drawing, frame(2 * k), ELEVATIONS, y, &format!("residuals, {title}"), true);
        for (constellation, points) in &points {
            let dots_of: Vec<(f64, f64)> = points.iter().map(|&(x, y, _)| (x, y)).collect();
            dots(&mut panel, &dots_of, (0.2, 0.0), COLORS[constellation.index()]);
        }
        panel.finish(&legend);
        let high = bound(points.values().flatten().map(|point| point.2)) * 1.2;
        let y = Range { low: 0.0, high };
        let title = format!("standard deviations, {title}");
        let mut panel = Panel::new(&mut drawing, frame(2 * k + 1), ELEVATIONS, y, &title, true);
        for (constellation, points) in &points {
            let dots_of: Vec<(f64, f64)> = points.iter().map(|&(x, _, sigma)| (x, sigma)).collect();
            dots(&mut panel, &dots_of, (0.2, 0.0), COLORS[constellation.index()]);
        }
        panel.finish(&legend);
    }
    drawing
}

/// Position against the last one, east, north and up.
fn convergence(run: &Run) -> Drawing {
    let mut drawing = drawing(3, "position less the last one [m], over hours; band: three standard deviations");
    let good: Vec<_> = run.solutions.iter().filter(|s| s.solution.quality != Quality::None).collect();
    let (Some(first), Some(last)) = (good.first(), good.last()) else { return drawing };
    let place = Geodetic::from_ecef(&last.solution.position);
    let hours = |s: &&surefix_core::ppp::PppSolution| s.solution.time.since(first.solution.time) / 3600.0;
    let x = Range { low: 0.0, high: hours(last).max(1e-3) };
    for (k, title) in ["east [m]", "north [m]", "up [m]"].into_iter().enumerate() {
        let series: Vec<(f64, f64, f64)> = good
            .iter()
            .map(|s| {
                let error = place.ecef_to_enu(&(s.solution.position - last.solution.position));
                let sigma = place.covariance_to_enu(&s.solution.position_covariance)[(k, k)].max(0.0).sqrt();
                (hours(s), error[k], sigma)
            })
            .collect();
        let high = bound(series.iter().skip(series.len() / 20).map(|point| point.1)).max(0.02) * 1.3;
        let mut panel = Panel::new(&mut drawing, frame(k), x, Range { low: -high, high }, title, true);
        let band = |sign: f64| series.iter().map(move |&(x, y, sigma)| (x, y + sign * 3.0 * sigma));
        let around: Vec<(f64, f64)> = band(1.0).chain(band(-1.0).rev()).collect();
        panel.band(&around, BLUE, 0.15);
        panel.line(&series.iter().map(|&(x, y, _)| (x, y)).collect::<Vec<_>>(), BLUE, 1.0);
        panel.finish(&[]);
    }
    drawing
}

/// Root mean square of the standard deviations in steps of elevation.
fn noise(smoothed: &Smoothed) -> Drawing {
    let mut drawing = drawing(2, "learned standard deviations over elevation [deg]");
    for (k, kind) in TapeKind::ALL.into_iter().enumerate() {
        let mut sums: BTreeMap<u16, Vec<(f64, f64)>> = BTreeMap::new();
        for (row, variance) in smoothed.tape.rows.iter().zip(&smoothed.variances).filter(|(row, _)| row.kind == kind) {
            let bins = sums.entry(row.group).or_insert_with(|| vec![(0.0, 0.0); 18]);
            let bin = ((row.elevation.to_degrees() / 5.0) as usize).min(17);
            bins[bin].0 += variance;
            bins[bin].1 += 1.0;
        }
        let level = |&(sum, count): &(f64, f64)| if count > 0.0 { (sum / count).sqrt() } else { f64::NAN };
        let high = bound(sums.values().flatten().map(level)) * 1.2;
        let title = format!("{} [m]", kind.name());
        let mut panel = Panel::new(&mut drawing, frame(k), ELEVATIONS, Range { low: 0.0, high }, &title, true);
        let color = |group: &u16| COLORS[smoothed.tape.groups[usize::from(*group)].constellation.index()];
        for (group, bins) in &sums {
            let line: Vec<(f64, f64)> =
                bins.iter().enumerate().map(|(i, bin)| (5.0 * i as f64 + 2.5, level(bin))).collect();
            panel.line(&line, color(group), 1.5);
        }
        let legend: Vec<(&str, Color)> =
            sums.keys().map(|group| (smoothed.tape.groups[usize::from(*group)].name.as_str(), color(group))).collect();
        panel.finish(&legend);
    }
    drawing
}

fn likelihood(smoothed: &Smoothed) -> Drawing {
    let mut drawing = drawing(1, "-2 ln L less its last value, logarithmic, over iterations");
    let history = &smoothed.report.history;
    let last = history.last().map_or(0.0, |step| step.likelihood);
    let points: Vec<(f64, f64)> =
        history.iter().enumerate().map(|(i, step)| (i as f64, (step.likelihood - last).max(1e-3).log10())).collect();
    let high = points.iter().map(|point| point.1).fold(0.0, f64::max).ceil();
    let x = Range { low: 0.0, high: (history.len().max(2) - 1) as f64 };
    let mut panel = Panel::new(&mut drawing, frame(0), x, Range { low: -3.0, high }, "lg difference", true);
    panel.line(&points, BLUE, 1.5);
    panel.finish(&[]);
    drawing
}
