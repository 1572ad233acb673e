//! A page as PNG, with its size on paper.

use super::font;
use super::look::POINTS_PER_INCH;
use super::origin::{Origin, PROGRAM};
use super::palette::Colour;
use super::scale::count;
use super::scene::{Page, Shape, Stroke, Text, corners, polygon, single};
use png::{BitDepth, ColorType, Encoder, PixelDimensions, Unit};
use tiny_skia::{
    Color, FillRule, LineCap, LineJoin, Mask, Paint, Path, PathBuilder, Pixmap, StrokeDash,
    Transform,
};
use ttf_parser::OutlineBuilder;

/// Maximum number of dots of a picture that viewers can open.
const DOTS: f64 = 4e8;

/// The file at this resolution, with its origin.
///
/// # Errors
/// A page that has too many dots.
pub(super) fn write(page: &Page, dpi: u32, origin: &Origin) -> Result<Vec<u8>, String> {
    let scale = f64::from(dpi) / POINTS_PER_INCH;
    let [width, height] = [page.width, page.height].map(|points| (scale * points).round());
    let picture = (width * height <= DOTS)
        .then(|| Pixmap::new(dots(width), dots(height)))
        .flatten();
    let mut picture = picture.ok_or_else(|| {
        format!(
            "{width} by {height} dots are too many for a PNG: draw it smaller, or with a lower dpi"
        )
    })?;
    picture.fill(Color::WHITE);
    let scaled = Transform::from_scale(single(scale), single(scale));
    draw(&mut picture, &page.shapes, scaled, None);
    encode(&picture, dpi, origin).map_err(|error| error.to_string())
}

/// Draws shapes within a clip.
fn draw(picture: &mut Pixmap, shapes: &[Shape], scaled: Transform, clip: Option<&Mask>) {
    for shape in shapes {
        match shape {
            Shape::Path { path, fill, stroke } => {
                if let Some((colour, opacity)) = fill {
                    let paint = paint(*colour, *opacity);
                    picture.fill_path(path, &paint, FillRule::Winding, scaled, clip);
                }
                if let Some(stroke) = stroke {
                    let paint = paint(stroke.colour, 1.0);
                    picture.stroke_path(path, &paint, &line(stroke), scaled, clip);
                }
            }
            Shape::Text(text) => {
                if let Some(path) = letters(text) {
                    let paint = paint(Colour::INK, 1.0);
                    picture.fill_path(&path, &paint, FillRule::Winding, scaled, clip);
                }
            }
            Shape::Within(ends, shapes) => {
                let mut mask = Mask::new(picture.width(), picture.height());
                if let (Some(mask), Some(path)) = (&mut mask, polygon(corners(*ends))) {
                    mask.fill_path(&path, FillRule::Winding, true, scaled);
                }
                draw(picture, shapes, scaled, mask.as_ref());
            }
        }
    }
}

/// A number of dots.
fn dots(number: f64) -> u32 {
    u32::try_from(count(number)).unwrap_or(u32::MAX)
}

fn paint(colour: Colour, opacity: f32) -> Paint<'static> {
    let [red, green, blue] = colour.channels();
    let mut color = Color::from_rgba8(red, green, blue, 255);
    color.apply_opacity(opacity);
    let mut paint = Paint::default();
    paint.set_color(color);
    paint
}

fn line(stroke: &Stroke) -> tiny_skia::Stroke {
    let dashes = stroke.dashes.map(|lengths| lengths.map(single).to_vec());
    tiny_skia::Stroke {
        width: single(stroke.width),
        line_join: LineJoin::Round,
        line_cap: if stroke.is_round {
            LineCap::Round
        } else {
            LineCap::Butt
        },
        dash: dashes.and_then(|lengths| StrokeDash::new(lengths, 0.0)),
        ..tiny_skia::Stroke::default()
    }
}

/// The outlines of the letters of a text.
fn letters(text: &Text) -> Option<Path> {
    let mut outline = Outline(PathBuilder::new());
    let mut all = PathBuilder::new();
    let [x, y] = text.start().map(single);
    let scale = single(text.size) / f32::from(font::FACE.units_per_em());
    let turn = if text.upright { -90.0 } else { 0.0 };
    let place = Transform::from_translate(x, y).pre_rotate(turn);
    let mut along = 0.0;
    for glyph in text.words.chars().map(font::glyph) {
        font::FACE.outline_glyph(glyph, &mut outline);
        let shifted = place.pre_translate(single(along), 0.0);
        let drawn = std::mem::replace(&mut outline.0, PathBuilder::new()).finish();
        if let Some(path) = drawn.and_then(|path| path.transform(shifted.pre_scale(scale, -scale)))
        {
            all.push_path(&path);
        }
        along += text.size * font::advance(glyph);
    }
    all.finish()
}

/// The outline of a letter in the units of its font.
struct Outline(PathBuilder);

impl OutlineBuilder for Outline {
    fn move_to(&mut self, x: f32, y: f32) {
        self.0.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.0.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.0.quad_to(x1, y1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.0.cubic_to(x1, y1, x2, y2, x, y);
    }

    fn close(&mut self) {
        self.0.close();
    }
}

/// The picture as a file, with its size on paper and its origin.
fn encode(picture: &Pixmap, dpi: u32, origin: &Origin) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, picture.width(), picture.height());
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    let per_metre = dots((f64::from(dpi) / 0.0254).round());
    encoder.set_pixel_dims(Some(PixelDimensions {
        xppu: per_metre,
        yppu: per_metre,
        unit: Unit::Meter,
    }));
    encoder.add_itxt_chunk("Title".into(), origin.title.clone())?;
    encoder.add_itxt_chunk("Source".into(), origin.text.clone())?;
    encoder.add_text_chunk("Software".into(), PROGRAM.into())?;
    // No transparency: the page is white below.
    let colours: Vec<u8> = picture
        .pixels()
        .iter()
        .flat_map(|dot| [dot.red(), dot.green(), dot.blue()])
        .collect();
    encoder.write_header()?.write_image_data(&colours)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::figure::scene::Anchor;

    /// A page of 20 × 20 points at one dot per point: the colour of each dot.
    fn drawn(shapes: Vec<Shape>) -> impl Fn(usize, usize) -> [u8; 3] {
        let page = Page {
            width: 20.0,
            height: 20.0,
            shapes,
        };
        let file = write(&page, 72, &Origin::of(&[])).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(file))
            .read_info()
            .unwrap();
        let mut dots = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut dots).unwrap();
        move |x, y| dots[3 * (20 * y + x)..][..3].try_into().unwrap()
    }

    const WHITE: [u8; 3] = [255; 3];
    const BLACK: [u8; 3] = [0; 3];

    #[test]
    fn areas_and_dashed_lines_are_drawn_within_their_clip() {
        let black = Colour::default();
        let filled = |ends, opacity| Shape::filled(corners(ends), black, opacity).unwrap();
        let dashed = Stroke::solid(black, 1.0).dashed(4.0, 2.0);
        let dot = drawn(vec![
            Shape::Within(
                [[0.0, 0.0], [10.0, 20.0]],
                vec![filled([[2.0, 2.0], [18.0, 8.0]], 1.0)],
            ),
            filled([[2.0, 10.0], [8.0, 12.0]], 0.5),
            Shape::line([[0.0, 15.5], [20.0, 15.5]], dashed).unwrap(),
        ]);
        assert_eq!([dot(4, 4), dot(12, 4), dot(4, 9)], [BLACK, WHITE, WHITE]);
        assert!(dot(4, 10)[0].abs_diff(128) < 2);
        let dashes = [0, 3, 4, 5, 6, 9, 10].map(|x| dot(x, 15) == BLACK);
        assert_eq!(dashes, [true, true, false, false, true, true, false]);
    }

    #[test]
    fn letters_stand_before_their_place_and_run_upwards() {
        let across = drawn(Text::new([20.0, 18.0], "MM", 8.0, Anchor::End).shapes());
        let upwards = Text::new([12.0, 18.0], "MM", 8.0, Anchor::Start).upright();
        let upwards = drawn(upwards.shapes());
        let ink = |dot: &dyn Fn(usize, usize) -> [u8; 3], [x, y]: [usize; 2]| {
            let mut square = (x..x + 6).flat_map(|x| (y..y + 6).map(move |y| (x, y)));
            square.any(|(x, y)| dot(x, y)[0] < 128)
        };
        assert!(ink(&across, [6, 12]) && !ink(&across, [6, 0]));
        assert!(ink(&upwards, [6, 6]) && !ink(&upwards, [13, 6]));
    }

    #[test]
    fn a_picture_of_too_many_dots_is_refused() {
        let page = Page {
            width: 1700.0,
            height: 1700.0,
            shapes: Vec::new(),
        };
        let error = write(&page, 2400, &Origin::of(&[])).unwrap_err();
        assert!(error.contains("lower dpi"), "{error}");
    }
}
