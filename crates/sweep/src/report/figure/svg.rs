//! A page as SVG.

use super::font;
use super::look::Length;
use super::origin::Origin;
use super::palette::Colour;
use super::scene::{Anchor, Page, Shape};
use base64::Engine as _;
use std::fmt::Write as _;
use tiny_skia::{Path, PathSegment};

/// The file: with a size in millimetres, a view box in points, its font and its origin.
pub(super) fn write(page: &Page, origin: &Origin) -> Vec<u8> {
    let [width, height] = [page.width, page.height].map(|points| Length(points).in_mm());
    let font = base64::engine::general_purpose::STANDARD.encode(font::BYTES);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.3}mm\" height=\"{height:.3}mm\" \
         viewBox=\"0 0 {w} {h}\" font-family=\"'{name}', 'DejaVu Sans', sans-serif\" fill=\"{ink}\" \
         stroke-linejoin=\"round\">\n\
         <title>{title}</title>\n<metadata>{origin}</metadata>\n\
         <style>@font-face{{font-family:'{name}';src:url(data:font/ttf;base64,{font})}}</style>\n\
         <rect width=\"{w}\" height=\"{h}\" fill=\"{white}\"/>\n",
        w = rounded(page.width),
        h = rounded(page.height),
        name = font::EMBEDDED_NAME,
        ink = Colour::INK,
        white = Colour::WHITE,
        title = escaped(&origin.title),
        origin = escaped(&origin.text),
    );
    for (number, shape) in page.shapes.iter().enumerate() {
        svg.push_str(&element(number, shape));
        svg.push('\n');
    }
    svg.push_str("</svg>\n");
    svg.into_bytes()
}

/// A length to a hundredth of a point.
fn rounded(points: f64) -> f64 {
    (100.0 * points).round() / 100.0
}

/// Escaped text.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

/// A shape; its number tells clips apart.
fn element(number: usize, shape: &Shape) -> String {
    match shape {
        Shape::Path {
            path: shown,
            fill,
            stroke,
        } => {
            let mut text = format!("<path d=\"{}\" fill=\"", path(shown));
            let _ = match fill {
                None => write!(text, "none\""),
                Some((colour, 1.0)) => write!(text, "{colour}\""),
                Some((colour, opacity)) => {
                    write!(text, "{colour}\" fill-opacity=\"{opacity}\"")
                }
            };
            if let Some(stroke) = stroke {
                let (colour, width) = (stroke.colour, rounded(stroke.width));
                let _ = write!(text, " stroke=\"{colour}\" stroke-width=\"{width}\"");
                if stroke.is_round {
                    text.push_str(" stroke-linecap=\"round\"");
                }
                if let Some([dash, gap]) = stroke.dashes {
                    let _ = write!(text, " stroke-dasharray=\"{dash} {gap}\"");
                }
            }
            text + "/>"
        }
        Shape::Text(text) => {
            let [x, y] = text.place.map(rounded);
            let anchor = match text.anchor {
                Anchor::Start => "start",
                Anchor::Middle => "middle",
                Anchor::End => "end",
            };
            let turn = if text.upright {
                format!(" transform=\"rotate(-90 {x} {y})\"")
            } else {
                String::new()
            };
            let (size, words) = (rounded(text.size), escaped(&text.words));
            format!(
                "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\" text-anchor=\"{anchor}\"{turn}>{words}</text>"
            )
        }
        Shape::Within([from, to], shapes) => {
            let [left, top, right, bottom] = [from[0], from[1], to[0], to[1]].map(rounded);
            let inside = shapes.iter().map(|shape| element(number, shape));
            format!(
                "<clipPath id=\"clip{number}\"><path d=\"M{left} {top}H{right}V{bottom}H{left}Z\"/></clipPath>\
                 <g clip-path=\"url(#clip{number})\">\n{}\n</g>",
                inside.collect::<Vec<_>>().join("\n")
            )
        }
    }
}

/// The data of a path.
fn path(path: &Path) -> String {
    let mut text = String::new();
    for segment in path.segments() {
        let (letter, places) = match segment {
            PathSegment::MoveTo(to) => ('M', vec![to]),
            PathSegment::LineTo(to) => ('L', vec![to]),
            PathSegment::QuadTo(control, to) => ('Q', vec![control, to]),
            PathSegment::CubicTo(a, b, to) => ('C', vec![a, b, to]),
            PathSegment::Close => ('Z', Vec::new()),
        };
        let places = places.into_iter().map(|place| {
            let [x, y] = [place.x, place.y].map(|length| rounded(length.into()));
            format!("{x} {y}")
        });
        text.push(letter);
        text.push_str(&places.collect::<Vec<_>>().join(" "));
    }
    text
}
