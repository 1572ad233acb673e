//! A page as SVG.

use super::font;
use super::look::Length;
use super::origin::Origin;
use super::palette::Colour;
use super::scene::{Anchor, Page, Place, Segment, Shape, Stroke};
use base64::Engine as _;
use std::fmt::Write as _;

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

/// Text that is no markup.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

/// A shape; its number tells clips apart.
fn element(number: usize, shape: &Shape) -> String {
    match shape {
        Shape::Path {
            segments,
            fill,
            stroke,
        } => {
            let path = path(segments);
            let fill = fill.map_or("none".to_owned(), |fill| match fill.opacity {
                1.0 => fill.colour.to_string(),
                opacity => format!("{}\" fill-opacity=\"{opacity}", fill.colour),
            });
            let stroke = stroke.as_ref().map_or(String::new(), stroke_attributes);
            format!("<path d=\"{path}\" fill=\"{fill}\"{stroke}/>")
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
        Shape::Clip(segments) => {
            let path = path(segments);
            format!(
                "<clipPath id=\"clip{number}\"><path d=\"{path}\"/></clipPath>\
                 <g clip-path=\"url(#clip{number})\">"
            )
        }
        Shape::EndClip => "</g>".to_owned(),
    }
}

fn stroke_attributes(stroke: &Stroke) -> String {
    let (colour, width) = (stroke.colour, rounded(stroke.width));
    let mut text = format!(" stroke=\"{colour}\" stroke-width=\"{width}\"");
    if let Some([dash, gap]) = stroke.dashes {
        let _ = write!(text, " stroke-dasharray=\"{dash} {gap}\"");
    }
    text
}

/// The data of a path.
fn path(segments: &[Segment]) -> String {
    let mut path = String::new();
    let mut add = |letter: char, places: &[Place]| {
        path.push(letter);
        for (number, length) in places.as_flattened().iter().enumerate() {
            let space = if number > 0 { " " } else { "" };
            let _ = write!(path, "{space}{}", rounded(*length));
        }
    };
    for segment in segments {
        match segment {
            Segment::Move(place) => add('M', &[*place]),
            Segment::Line(place) => add('L', &[*place]),
            Segment::Curve(places) => add('C', places),
            Segment::Close => add('Z', &[]),
        }
    }
    path
}
