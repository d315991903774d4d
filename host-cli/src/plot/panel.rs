//! Axes with ticks, and data on them.

use super::{Anchor, BLACK, CHARACTER, Color, Drawing, GRAY};

/// A range of values along one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// At the left or the bottom.
    pub low: f64,
    /// At the right or the top.
    pub high: f64,
}

/// Where a panel lies in its drawing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Left edge.
    pub left: f64,
    /// Top edge.
    pub top: f64,
    /// Width.
    pub width: f64,
    /// Height.
    pub height: f64,
}

/// A frame with axes. Data beyond the range of y are drawn at its edge.
#[derive(Debug)]
pub struct Panel<'a> {
    drawing: &'a mut Drawing,
    frame: Frame,
    x: Range,
    y: Range,
}

impl<'a> Panel<'a> {
    /// Draws grid, ticks and title; `label_x` is whether the ticks below have numbers.
    pub fn new(drawing: &'a mut Drawing, frame: Frame, x: Range, y: Range, title: &str, label_x: bool) -> Self {
        let Frame { left, top, width, height } = frame;
        let (right, bottom) = (left + width, top + height);
        let panel = Self { drawing, frame, x, y };
        for value in ticks(x, 8) {
            let at = panel.place(value, y.low).0;
            panel.drawing.line(vec![(at, top), (at, bottom)], GRAY, 0.7);
            if label_x {
                panel.drawing.text((at, bottom + 11.0), Anchor::Middle, number(value), BLACK);
            }
        }
        for value in ticks(y, 5) {
            let at = panel.place(x.low, value).1;
            panel.drawing.line(vec![(left, at), (right, at)], GRAY, 0.7);
            panel.drawing.text((left - 6.0, at), Anchor::End, number(value), BLACK);
        }
        panel.drawing.text((left, top - 10.0), Anchor::Start, title, BLACK);
        panel
    }

    /// Draws a line through points, broken where one is not finite.
    pub fn line(&mut self, points: &[(f64, f64)], color: Color, width: f64) {
        for part in points.split(|(x, y)| !x.is_finite() || !y.is_finite()).filter(|part| part.len() > 1) {
            let placed = part.iter().map(|&(x, y)| self.place(x, y)).collect();
            self.drawing.line(placed, color, width);
        }
    }

    /// Draws a line that keeps each value until the next.
    pub fn steps(&mut self, points: &[(f64, f64)], color: Color, width: f64) {
        let corners = points.windows(2).flat_map(|pair| [pair[0], (pair[1].0, pair[0].1)]);
        let stairs: Vec<(f64, f64)> = corners.chain(points.last().copied()).collect();
        self.line(&stairs, color, width);
    }

    /// Fills what lies between −y and y.
    pub fn band(&mut self, points: &[(f64, f64)], color: Color, opacity: f64) {
        let finite = || points.iter().filter(|(x, y)| x.is_finite() && y.is_finite());
        let upper = finite().map(|&(x, y)| self.place(x, y));
        let lower = finite().rev().map(|&(x, y)| self.place(x, -y));
        let corners = upper.chain(lower).collect();
        self.drawing.area(corners, color, opacity);
    }

    /// Writes names of series in their colours at the upper right, and closes the frame.
    pub fn finish(self, legend: &[(&str, Color)]) {
        let Frame { left, top, width, height } = self.frame;
        let (right, bottom) = (left + width, top + height);
        let border = vec![(left, top), (right, top), (right, bottom), (left, bottom), (left, top)];
        self.drawing.line(border, BLACK, 1.0);
        let mut at = right;
        for (name, color) in legend.iter().rev() {
            self.drawing.text((at, top - 10.0), Anchor::End, *name, *color);
            at -= CHARACTER * (name.chars().count() + 2) as f64;
        }
    }

    /// Where a point of the data lies in the drawing.
    fn place(&self, x: f64, y: f64) -> (f64, f64) {
        let Frame { left, top, width, height } = self.frame;
        let share = |range: Range, value: f64| ((value - range.low) / (range.high - range.low)).clamp(0.0, 1.0);
        (left + width * share(self.x, x), top + height * (1.0 - share(self.y, y)))
    }
}

/// Round numbers in the range, `most` or a few less, at distances of 1, 2 or 5 times a power of ten.
fn ticks(range: Range, most: usize) -> Vec<f64> {
    let length = range.high - range.low;
    if !(length > 0.0 && length.is_finite()) || most == 0 {
        return Vec::new();
    }
    let least = length / most as f64;
    let power = 10.0_f64.powf(least.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|step| *step >= least).unwrap_or(length);
    let first = (range.low / step - 1e-9).ceil();
    let count = ((range.high / step + 1e-9).floor() - first) as usize;
    (0..=count).map(|k| (first + k as f64) * step).collect()
}

/// Without digits that only rounding made.
fn number(value: f64) -> String {
    let rounded = (value * 1e6).round() / 1e6;
    // −0 has a sign.
    (rounded + 0.0).to_string()
}

#[cfg(test)]
mod tests {
    use super::super::{BLUE, Shape};
    use super::*;

    #[test]
    fn ticks_are_round() {
        let labels = |low, high, most| ticks(Range { low, high }, most).into_iter().map(number).collect::<Vec<_>>();
        assert_eq!(labels(0.0, 30.0, 8), ["0", "5", "10", "15", "20", "25", "30"]);
        assert_eq!(labels(-0.25, 0.25, 5), ["-0.2", "-0.1", "0", "0.1", "0.2"]);
        assert_eq!(labels(-2.0, 2.0, 5), ["-2", "-1", "0", "1", "2"]);
        assert!(ticks(Range { low: 1.0, high: 1.0 }, 5).is_empty());
        assert!(ticks(Range { low: f64::NAN, high: 1.0 }, 5).is_empty());
    }

    fn lines_of(draw: impl FnOnce(&mut Panel<'_>)) -> Vec<Vec<(f64, f64)>> {
        let mut drawing = Drawing::new(100, 100);
        let frame = Frame { left: 0.0, top: 0.0, width: 100.0, height: 100.0 };
        let range = Range { low: 0.0, high: 10.0 };
        draw(&mut Panel::new(&mut drawing, frame, range, range, "", true));
        let of_data = |shape| match shape {
            Shape::Line { points, color: BLUE, .. } => Some(points),
            _ => None,
        };
        drawing.shapes.into_iter().filter_map(of_data).collect()
    }

    #[test]
    fn lines_break_at_gaps_and_stay_in_the_frame() {
        let points = [(0.0, 0.0), (1.0, 20.0), (2.0, f64::NAN), (3.0, 5.0), (4.0, 5.0)];
        let lines = lines_of(|panel| panel.line(&points, BLUE, 1.0));
        assert_eq!(lines, [[(0.0, 100.0), (10.0, 0.0)], [(30.0, 50.0), (40.0, 50.0)]]);
    }

    #[test]
    fn steps_keep_a_value_until_the_next() {
        let lines = lines_of(|panel| panel.steps(&[(0.0, 0.0), (1.0, 1.0)], BLUE, 1.0));
        assert_eq!(lines, [[(0.0, 100.0), (10.0, 100.0), (10.0, 90.0)]]);
    }
}
