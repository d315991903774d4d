//! A drawing as PNG, at twice its size.
//!
//! Text is set in rasters of Noto Sans Mono that are part of the program, so that a picture is the same on every machine.

use super::{Anchor, Color, Drawing, Shape};
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};
use tiny_skia::{FillRule, LineJoin, Paint, Path, PathBuilder, Pixmap, Stroke, Transform};

/// Pixels of the picture per pixel of the drawing.
const SCALE: f64 = 2.0;
const WEIGHT: FontWeight = FontWeight::Regular;
const HEIGHT: RasterHeight = RasterHeight::Size24;

/// Why a picture was not made.
#[derive(Debug, thiserror::Error)]
pub enum PngError {
    /// It has no pixels, or more than memory can hold.
    #[error("a picture of {width} × {height} cannot be made")]
    Size {
        /// Width of the drawing.
        width: u32,
        /// Height of the drawing.
        height: u32,
    },
    /// It could not be encoded.
    #[error("the picture cannot be encoded: {0}")]
    Encoding(String),
}

/// The file.
pub fn render(drawing: &Drawing) -> Result<Vec<u8>, PngError> {
    let (width, height) = (drawing.width, drawing.height);
    let scale = SCALE as u32;
    let mut picture = width
        .checked_mul(scale)
        .zip(height.checked_mul(scale))
        .and_then(|(width, height)| Pixmap::new(width, height))
        .ok_or(PngError::Size { width, height })?;
    picture.fill(tiny_skia::Color::WHITE);
    for shape in &drawing.shapes {
        match shape {
            Shape::Line { points, color, width } => {
                let stroke = Stroke { width: *width as f32, line_join: LineJoin::Round, ..Stroke::default() };
                if let Some(path) = path(points, false) {
                    picture.stroke_path(&path, &paint(*color, 1.0), &stroke, transform(), None);
                }
            }
            Shape::Area { points, color, opacity } => {
                if let Some(path) = path(points, true) {
                    picture.fill_path(&path, &paint(*color, *opacity), FillRule::Winding, transform(), None);
                }
            }
            Shape::Text { at, anchor, text, color } => write(&mut picture, *at, *anchor, text, *color),
        }
    }
    picture.encode_png().map_err(|error| PngError::Encoding(error.to_string()))
}

fn transform() -> Transform {
    Transform::from_scale(SCALE as f32, SCALE as f32)
}

fn paint(Color(red, green, blue): Color, opacity: f64) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(red, green, blue, (255.0 * opacity).round() as u8);
    paint
}

/// `None` for fewer than two points, or points at infinity.
fn path(points: &[(f64, f64)], closed: bool) -> Option<Path> {
    let mut builder = PathBuilder::new();
    for (i, &(x, y)) in points.iter().enumerate() {
        match i {
            0 => builder.move_to(x as f32, y as f32),
            _ => builder.line_to(x as f32, y as f32),
        }
    }
    if closed {
        builder.close();
    }
    builder.finish()
}

/// Sets a text; characters that are not in the font are question marks, pixels outside the picture are left out.
fn write(picture: &mut Pixmap, at: (f64, f64), anchor: Anchor, text: &str, Color(red, green, blue): Color) {
    let advance = get_raster_width(WEIGHT, HEIGHT) as i64;
    let length = advance * text.chars().count() as i64;
    let left = (SCALE * at.0).round() as i64
        - match anchor {
            Anchor::Start => 0,
            Anchor::Middle => length / 2,
            Anchor::End => length,
        };
    let top = (SCALE * at.1).round() as i64 - HEIGHT.val() as i64 / 2;
    let (width, height) = (i64::from(picture.width()), i64::from(picture.height()));
    let data = picture.data_mut();
    for (k, character) in text.chars().enumerate() {
        let Some(glyph) = get_raster(character, WEIGHT, HEIGHT).or_else(|| get_raster('?', WEIGHT, HEIGHT)) else {
            continue;
        };
        for (row, intensities) in glyph.rows().enumerate() {
            for (column, &intensity) in intensities.iter().enumerate() {
                let (x, y) = (left + k as i64 * advance + column as i64, top + row as i64);
                if !(0..width).contains(&x) || !(0..height).contains(&y) {
                    continue;
                }
                // The ground is opaque: red, green, blue, alpha = 255.
                let start = 4 * (y * width + x) as usize;
                for (ground, ink) in data[start..start + 3].iter_mut().zip([red, green, blue]) {
                    let (ground_part, ink_part) = (255 - u32::from(intensity), u32::from(intensity));
                    *ground = ((u32::from(*ground) * ground_part + u32::from(ink) * ink_part + 127) / 255) as u8;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{BLACK, RED};
    use super::*;

    fn pixels(drawing: &Drawing) -> Pixmap {
        Pixmap::decode_png(&render(drawing).unwrap()).unwrap()
    }

    #[test]
    fn an_area_covers_what_is_inside() {
        let mut drawing = Drawing::new(20, 10);
        drawing.area(vec![(5.0, 2.0), (15.0, 2.0), (15.0, 8.0), (5.0, 8.0)], RED, 1.0);
        let picture = pixels(&drawing);
        let color = |x, y| picture.pixel(x, y).map(|p| (p.red(), p.green(), p.blue())).unwrap();
        assert_eq!((picture.width(), picture.height()), (40, 20));
        assert_eq!((color(20, 10), color(2, 2)), ((RED.0, RED.1, RED.2), (255, 255, 255)));
    }

    /// Ink lies on the side of the point that the anchor says, and text beyond the border does no harm.
    #[test]
    fn text_is_anchored() {
        let ink = |anchor| {
            let mut drawing = Drawing::new(100, 20);
            drawing.text((50.0, 10.0), anchor, "MMMM", BLACK);
            drawing.text((1e9, -1e9), anchor, "far \u{3c3}", BLACK);
            let picture = pixels(&drawing);
            let dark = |columns: std::ops::Range<u32>| {
                columns
                    .flat_map(|x| (0..40).map(move |y| (x, y)))
                    .filter(|&(x, y)| picture.pixel(x, y).unwrap().red() < 128)
                    .count()
            };
            (dark(0..100), dark(100..200))
        };
        let (start, middle, end) = (ink(Anchor::Start), ink(Anchor::Middle), ink(Anchor::End));
        assert!(start.0 == 0 && start.1 > 100 && end.0 > 100 && end.1 == 0);
        assert!(middle.0 > 50 && middle.1 > 50);
    }

    #[test]
    fn impossible_sizes_are_refused() {
        assert!(matches!(render(&Drawing::new(0, 10)), Err(PngError::Size { width: 0, height: 10 })));
        assert!(render(&Drawing::new(u32::MAX, u32::MAX)).is_err());
    }
}
