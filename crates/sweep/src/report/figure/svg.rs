//! A page as SVG.

use super::font;
use super::look::{Length, POINTS_PER_INCH};
use super::origin::Origin;
use super::palette::Colour as Paint;
use super::shape::{Anchor, Page, Shape, Stroke};
use base64::Engine as _;
use kuva::backend::svg::SvgBackend;
use kuva::render::color::Color;
use kuva::render::render::{PathData, Primitive, Scene, TextAnchor};
use std::fmt::Write as _;

/// Units of a scene per point: sizes of letters are whole numbers of units.
pub(super) const UNITS: f64 = 100.0;

/// The file: with a size in millimetres, a view box in points, its font and its origin.
pub(super) fn write(page: &Page, origin: &Origin) -> Vec<u8> {
    let drawn = SvgBackend::new().render_scene(&scene(&page.shapes, page));
    // The head is written anew: the backend's has neither a view box nor units.
    let body = drawn.split_once('>').map_or("", |(_, body)| body);
    let mm = |points: f64| Length(points).in_mm();
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{:.3}mm\" height=\"{:.3}mm\" viewBox=\"0 0 {:.0} {:.0}\" \
         font-family=\"'{name}', 'DejaVu Sans', sans-serif\" fill=\"{}\">\n",
        mm(page.width),
        mm(page.height),
        page.width * UNITS,
        page.height * UNITS,
        Paint::INK,
        name = font::EMBEDDED_NAME,
    );
    let _ = writeln!(svg, "<title>{}</title>", escaped(&origin.title()));
    let _ = writeln!(svg, "<metadata>{}</metadata>", escaped(&origin.to_string()));
    let coded = base64::engine::general_purpose::STANDARD.encode(font::BYTES);
    let _ = write!(
        svg,
        "<style>@font-face{{font-family:'{}';src:url(data:font/ttf;base64,{coded})}}</style>",
        font::EMBEDDED_NAME
    );
    svg.push_str(body);
    svg.into_bytes()
}

/// Text that is no markup.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

/// Dots per unit of a scene at so many dots per inch.
pub(super) fn dots_per_unit(dpi: u32) -> f64 {
    f64::from(dpi) / POINTS_PER_INCH / UNITS
}

/// Shapes of a page as a scene of the drawing program.
pub(super) fn scene(shapes: &[Shape], page: &Page) -> Scene {
    let mut scene = Scene::new(page.width * UNITS, page.height * UNITS);
    scene.text_color = Some(Paint::INK.to_string());
    let mut clips = 0;
    for shape in shapes {
        let primitive = match shape {
            Shape::Line { places, stroke } => Primitive::PolyLine {
                points: places.iter().map(|[x, y]| (x * UNITS, y * UNITS)).collect(),
                stroke: colour(stroke.colour),
                stroke_width: stroke.width * UNITS,
                stroke_dasharray: dasharray(stroke),
            },
            Shape::Area {
                places,
                fill,
                opacity,
                stroke,
            } => Primitive::Path(Box::new(PathData {
                d: path(places),
                fill: Some(fill.map_or(Color::None, colour)),
                stroke: stroke.map_or(Color::None, |stroke| colour(stroke.colour)),
                stroke_width: stroke.map_or(0.0, |stroke| stroke.width * UNITS),
                opacity: (*opacity < 1.0).then_some(*opacity),
                stroke_dasharray: None,
            })),
            Shape::Disc {
                centre: [x, y],
                radius,
                fill,
                stroke,
            } => Primitive::Circle {
                cx: x * UNITS,
                cy: y * UNITS,
                r: radius * UNITS,
                fill: colour(*fill),
                fill_opacity: None,
                stroke: Some(colour(stroke.colour)),
                stroke_width: Some(stroke.width * UNITS),
            },
            Shape::Text {
                place: [x, y],
                words,
                size,
                anchor,
                upright,
            } => Primitive::Text {
                x: x * UNITS,
                y: y * UNITS,
                content: words.replace('$', "\\$"),
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "the size of letters"
                )]
                size: (size * UNITS).round() as u32,
                anchor: match anchor {
                    Anchor::Start => TextAnchor::Start,
                    Anchor::Middle => TextAnchor::Middle,
                    Anchor::End => TextAnchor::End,
                },
                rotate: upright.then_some(-90.0),
                bold: false,
                color: None,
            },
            Shape::Clip([[left, top], [right, bottom]]) => {
                clips += 1;
                Primitive::ClipStart {
                    x: left * UNITS,
                    y: top * UNITS,
                    width: (right - left) * UNITS,
                    height: (bottom - top) * UNITS,
                    id: format!("panel{clips}"),
                }
            }
            Shape::EndClip => Primitive::ClipEnd,
        };
        scene.add(primitive);
    }
    scene
}

fn colour(paint: Paint) -> Color {
    let [red, green, blue] = paint.channels();
    Color::Rgb(red, green, blue)
}

fn dasharray(stroke: &Stroke) -> Option<String> {
    let [dash, gap] = stroke.dashes?.map(|length| length * UNITS);
    Some(format!("{dash:.1} {gap:.1}"))
}

/// A closed path.
fn path(places: &[[f64; 2]]) -> String {
    let mut path = String::new();
    for (number, [x, y]) in places.iter().enumerate() {
        let letter = if number == 0 { 'M' } else { 'L' };
        let _ = write!(path, "{letter}{:.1} {:.1}", x * UNITS, y * UNITS);
    }
    path.push('Z');
    path
}
