//! Line plots as SVG and PNG from one drawing, without system fonts.
//!
//! [`panel::Panel`] turns data into shapes of a [`Drawing`]; [`svg`] and [`png`] write it. Coordinates are pixels at a
//! scale of one, x to the right and y down. Text is 12 pixels high in a font of fixed width, 7 pixels a character, in ASCII.

pub mod panel;
pub mod png;
pub mod svg;

/// A colour: red, green, blue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Color(pub u8, pub u8, pub u8);

/// Axes and text.
pub const BLACK: Color = Color(40, 40, 40);
/// Grid lines.
pub const GRAY: Color = Color(215, 215, 215);
/// First series, readable by the colour-blind beside [`RED`].
pub const BLUE: Color = Color(0, 90, 181);
/// Second series.
pub const RED: Color = Color(220, 50, 32);

/// Third series.
pub const GREEN: Color = Color(0, 130, 80);
/// Fourth series.
pub const ORANGE: Color = Color(240, 170, 60);

/// Width of a character.
pub const CHARACTER: f64 = 7.0;

/// Where a text lies relative to its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// Begins there.
    Start,
    /// Centred on it.
    Middle,
    /// Ends there.
    End,
}

/// What can be drawn.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// An open line.
    Line {
        /// Its points.
        points: Vec<(f64, f64)>,
        /// Its colour.
        color: Color,
        /// Its width.
        width: f64,
    },
    /// A filled polygon.
    Area {
        /// Its corners.
        points: Vec<(f64, f64)>,
        /// Its colour.
        color: Color,
        /// 0 for nothing to see, 1 for opaque.
        opacity: f64,
    },
    /// A line of text, vertically centred on its point.
    Text {
        /// Its point.
        at: (f64, f64),
        /// Which part of it is there.
        anchor: Anchor,
        /// What it says.
        text: String,
        /// Its colour.
        color: Color,
    },
}

/// Shapes on white, the first one at the bottom.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawing {
    /// Width of the picture.
    pub width: u32,
    /// Height of the picture.
    pub height: u32,
    /// What is on it.
    pub shapes: Vec<Shape>,
}

impl Drawing {
    /// An empty one.
    pub fn new(width: u32, height: u32) -> Self {
        Self { width, height, shapes: Vec::new() }
    }

    /// Adds a line.
    pub fn line(&mut self, points: Vec<(f64, f64)>, color: Color, width: f64) {
        self.shapes.push(Shape::Line { points, color, width });
    }

    /// Adds a polygon.
    pub fn area(&mut self, points: Vec<(f64, f64)>, color: Color, opacity: f64) {
        self.shapes.push(Shape::Area { points, color, opacity });
    }

    /// Adds a text.
    pub fn text(&mut self, at: (f64, f64), anchor: Anchor, text: impl Into<String>, color: Color) {
        self.shapes.push(Shape::Text { at, anchor, text: text.into(), color });
    }
}
