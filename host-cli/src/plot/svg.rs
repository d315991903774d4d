//! A drawing as SVG 1.1.

use super::{Anchor, Color, Drawing, Shape};
use std::fmt::Write;

/// The document.
pub fn render(drawing: &Drawing) -> String {
    let (width, height) = (drawing.width, drawing.height);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
         font-family=\"Noto Sans Mono, DejaVu Sans Mono, Menlo, Consolas, monospace\" font-size=\"11.6\">\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
    );
    for shape in &drawing.shapes {
        // Writing into a string cannot fail.
        let _ = match shape {
            Shape::Line { points, color, width } => writeln!(
                svg,
                "<polyline fill=\"none\" stroke=\"{}\" stroke-width=\"{width}\" stroke-linejoin=\"round\" points=\"{}\"/>",
                hex(*color),
                coordinates(points)
            ),
            Shape::Area { points, color, opacity } => writeln!(
                svg,
                "<polygon fill=\"{}\" fill-opacity=\"{opacity}\" points=\"{}\"/>",
                hex(*color),
                coordinates(points)
            ),
            Shape::Text { at: (x, y), anchor, text, color } => writeln!(
                svg,
                "<text x=\"{x:.1}\" y=\"{:.1}\" fill=\"{}\" text-anchor=\"{}\">{}</text>",
                y + 4.0,
                hex(*color),
                match anchor {
                    Anchor::Start => "start",
                    Anchor::Middle => "middle",
                    Anchor::End => "end",
                },
                escape(text)
            ),
        };
    }
    svg.push_str("</svg>\n");
    svg
}

fn hex(Color(red, green, blue): Color) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

fn coordinates(points: &[(f64, f64)]) -> String {
    points.iter().map(|(x, y)| format!("{x:.2},{y:.2}")).collect::<Vec<_>>().join(" ")
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::super::BLUE;
    use super::*;

    #[test]
    fn shapes_become_elements_in_order() {
        let mut drawing = Drawing::new(100, 50);
        drawing.area(vec![(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)], BLUE, 0.5);
        drawing.line(vec![(0.0, 0.0), (10.0, 5.0)], BLUE, 1.0);
        drawing.text((5.0, 6.0), Anchor::End, "a < b & c", BLUE);
        let svg = render(&drawing);
        let lines: Vec<&str> = svg.lines().collect();
        assert!(lines[0].starts_with("<svg ") && lines[0].contains("viewBox=\"0 0 100 50\""));
        assert!(
            lines[2].starts_with("<polygon fill=\"#005ab5\"") && lines[3].contains("points=\"0.00,0.00 10.00,5.00\"")
        );
        assert_eq!(lines[4], "<text x=\"5.0\" y=\"10.0\" fill=\"#005ab5\" text-anchor=\"end\">a &lt; b &amp; c</text>");
        assert_eq!(lines[5], "</svg>");
    }
}
