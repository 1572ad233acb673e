//! A page as PDF, with the letters it uses of its font.

use super::font;
use super::origin::Origin;
use super::palette::Colour;
use super::shape::{Page, Place, Shape, Stroke};
use pdf_writer::types::{
    CidFontType, FontFlags, LineCapStyle, LineJoinStyle, SystemInfo, UnicodeCmap,
};
use pdf_writer::{Content, Finish, Name, Pdf, Rect, Ref, Str, TextStr};
use std::collections::BTreeMap;
use subsetter::GlyphRemapper;

const FONT: Name<'static> = Name(b"F1");
/// A prefix of six letters says that the font is a part of itself.
const FONT_NAME: Name<'static> = Name(b"SWEEPF+DejaVuSans");
const SYSTEM: SystemInfo<'static> = SystemInfo {
    registry: Str(b"Adobe"),
    ordering: Str(b"Identity"),
    supplement: 0,
};
/// The distance of the ends of a quarter circle from its control points, over its radius.
const ARC: f64 = 0.552_284_75;

/// The objects of the file.
struct Objects {
    catalog: Ref,
    pages: Ref,
    page: Ref,
    content: Ref,
    font: Ref,
    letters: Ref,
    descriptor: Ref,
    file: Ref,
    unicode: Ref,
    info: Ref,
}

const OBJECTS: Objects = Objects {
    catalog: Ref::new(1),
    pages: Ref::new(2),
    page: Ref::new(3),
    content: Ref::new(4),
    font: Ref::new(5),
    letters: Ref::new(6),
    descriptor: Ref::new(7),
    file: Ref::new(8),
    unicode: Ref::new(9),
    info: Ref::new(10),
};

/// The file.
///
/// # Errors
/// A character that the font does not have.
pub(super) fn write(page: &Page, origin: &Origin) -> Result<Vec<u8>, String> {
    let mut writer = Writer {
        content: Content::new(),
        height: page.height,
        letters: GlyphRemapper::new(),
        characters: BTreeMap::new(),
        opacities: Vec::new(),
    };
    for shape in &page.shapes {
        writer.draw(shape)?;
    }
    let mut pdf = Pdf::new();
    pdf.catalog(OBJECTS.catalog).pages(OBJECTS.pages);
    pdf.pages(OBJECTS.pages).kids([OBJECTS.page]).count(1);
    let mut leaf = pdf.page(OBJECTS.page);
    leaf.media_box(Rect::new(0.0, 0.0, single(page.width), single(page.height)));
    leaf.parent(OBJECTS.pages);
    leaf.contents(OBJECTS.content);
    let mut resources = leaf.resources();
    resources.fonts().pair(FONT, OBJECTS.font);
    let mut states = resources.ext_g_states();
    for (number, opacity) in writer.opacities.iter().enumerate() {
        let name = state_name(number);
        let mut state = states
            .insert(Name(name.as_bytes()))
            .start::<pdf_writer::writers::ExtGraphicsState<'_>>();
        state.non_stroking_alpha(single(*opacity));
    }
    states.finish();
    resources.finish();
    leaf.finish();
    pdf.stream(OBJECTS.content, &writer.content.finish());
    write_font(&mut pdf, &writer.letters, &writer.characters)?;
    let mut info = pdf.document_info(OBJECTS.info);
    info.title(TextStr(&origin.title()));
    info.subject(TextStr(&origin.to_string()));
    info.creator(TextStr(&Origin::program()));
    info.finish();
    Ok(pdf.finish())
}

/// A number in single precision.
#[expect(clippy::cast_possible_truncation, reason = "a length on paper")]
fn single(number: f64) -> f32 {
    number as f32
}

/// The name of a degree of transparency.
fn state_name(number: usize) -> String {
    format!("G{number}")
}

/// Writes what is on the page.
struct Writer {
    content: Content,
    height: f64,
    /// Letters that are used, by their new numbers.
    letters: GlyphRemapper,
    /// Characters by the new numbers of their letters.
    characters: BTreeMap<u16, char>,
    opacities: Vec<f64>,
}

impl Writer {
    /// A place as PDF has it: y up.
    fn place(&self, [x, y]: Place) -> [f32; 2] {
        [single(x), single(self.height - y)]
    }

    fn stroke(&mut self, stroke: &Stroke) {
        let [red, green, blue] = channels(stroke.colour);
        self.content.set_stroke_rgb(red, green, blue);
        self.content.set_line_width(single(stroke.width));
        let dashes = stroke.dashes.map_or(Vec::new(), |d| d.map(single).to_vec());
        self.content.set_dash_pattern(dashes, 0.0);
        self.content.set_line_join(LineJoinStyle::RoundJoin);
        self.content.set_line_cap(LineCapStyle::ButtCap);
    }

    fn fill(&mut self, colour: Colour) {
        let [red, green, blue] = channels(colour);
        self.content.set_fill_rgb(red, green, blue);
    }

    fn path(&mut self, places: &[Place]) {
        for (number, place) in places.iter().enumerate() {
            let [x, y] = self.place(*place);
            if number == 0 {
                self.content.move_to(x, y);
            } else {
                self.content.line_to(x, y);
            }
        }
    }

    fn draw(&mut self, shape: &Shape) -> Result<(), String> {
        match shape {
            Shape::Line { places, stroke } => {
                self.stroke(stroke);
                self.path(places);
                self.content.stroke();
            }
            Shape::Area {
                places,
                fill,
                opacity,
                stroke,
            } => {
                self.content.save_state();
                if *opacity < 1.0 {
                    let known = self.opacities.iter().position(|o| o == opacity);
                    let number = known.unwrap_or(self.opacities.len());
                    if known.is_none() {
                        self.opacities.push(*opacity);
                    }
                    let name = state_name(number);
                    self.content.set_parameters(Name(name.as_bytes()));
                }
                if let Some(colour) = fill {
                    self.fill(*colour);
                }
                if let Some(stroke) = stroke {
                    self.stroke(stroke);
                }
                self.path(places);
                self.content.close_path();
                match (fill, stroke) {
                    (Some(_), Some(_)) => self.content.fill_nonzero_and_stroke(),
                    (Some(_), None) => self.content.fill_nonzero(),
                    (None, Some(_)) => self.content.stroke(),
                    (None, None) => self.content.end_path(),
                };
                self.content.restore_state();
            }
            Shape::Disc {
                centre,
                radius,
                fill,
                stroke,
            } => {
                self.fill(*fill);
                self.stroke(stroke);
                self.circle(*centre, *radius);
                self.content.fill_nonzero_and_stroke();
            }
            Shape::Text {
                place,
                words,
                size,
                anchor,
                upright,
            } => {
                let before = anchor.part() * font::width(words, *size);
                let [x, y] = *place;
                let start = if *upright {
                    [x, y + before]
                } else {
                    [x - before, y]
                };
                self.text(words, start, *size, *upright)?;
            }
            Shape::Clip([from, to]) => {
                self.content.save_state();
                let corners = [*from, [to[0], from[1]], *to, [from[0], to[1]]];
                self.path(&corners);
                self.content.close_path();
                self.content.clip_nonzero();
                self.content.end_path();
            }
            Shape::EndClip => {
                self.content.restore_state();
            }
        }
        Ok(())
    }

    /// A circle of four arcs.
    fn circle(&mut self, [x, y]: Place, radius: f64) {
        let at = |a: f64, b: f64| [x + radius * a, y + radius * b];
        let [start_x, start_y] = self.place(at(1.0, 0.0));
        self.content.move_to(start_x, start_y);
        let corners = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]];
        for n in 0..4 {
            let [from, to]: [[f64; 2]; 2] = [corners[n], corners[(n + 1) % 4]];
            let ends = [
                at(from[0] + ARC * to[0], from[1] + ARC * to[1]),
                at(to[0] + ARC * from[0], to[1] + ARC * from[1]),
                at(to[0], to[1]),
            ];
            let [one, two, three] = ends.map(|end| self.place(end));
            self.content
                .cubic_to(one[0], one[1], two[0], two[1], three[0], three[1]);
        }
        self.content.close_path();
    }

    fn text(&mut self, words: &str, start: Place, size: f64, upright: bool) -> Result<(), String> {
        let mut coded = Vec::with_capacity(2 * words.len());
        for character in words.chars() {
            let Some(glyph) = font::FACE.glyph_index(character) else {
                return Err(format!(
                    "the font of figures has no {character:?}, which {words:?} needs; SVG and PNG may show it"
                ));
            };
            let number = self.letters.remap(glyph.0);
            self.characters.insert(number, character);
            coded.extend(number.to_be_bytes());
        }
        let [x, y] = self.place(start);
        let matrix = if upright {
            [0.0, 1.0, -1.0, 0.0, x, y]
        } else {
            [1.0, 0.0, 0.0, 1.0, x, y]
        };
        self.fill(Colour::INK);
        self.content
            .begin_text()
            .set_font(FONT, single(size))
            .set_text_matrix(matrix)
            .show(Str(&coded))
            .end_text();
        Ok(())
    }
}

fn channels(colour: Colour) -> [f32; 3] {
    colour.channels().map(|channel| f32::from(channel) / 255.0)
}

/// Writes the font, with the letters used, their widths, and what they mean.
fn write_font(
    pdf: &mut Pdf,
    letters: &GlyphRemapper,
    characters: &BTreeMap<u16, char>,
) -> Result<(), String> {
    let face = &font::FACE;
    let per_em = |units: i16| 1000.0 * f32::from(units) / f32::from(face.units_per_em());
    pdf.type0_font(OBJECTS.font)
        .base_font(FONT_NAME)
        .encoding_predefined(Name(b"Identity-H"))
        .descendant_font(OBJECTS.letters)
        .to_unicode(OBJECTS.unicode);
    let mut cid = pdf.cid_font(OBJECTS.letters);
    cid.subtype(CidFontType::Type2)
        .base_font(FONT_NAME)
        .system_info(SYSTEM)
        .font_descriptor(OBJECTS.descriptor)
        .default_width(0.0)
        .cid_to_gid_map_predefined(Name(b"Identity"));
    let advances = letters
        .remapped_gids()
        .map(|glyph| single(1000.0 * font::advance(ttf_parser::GlyphId(glyph))));
    cid.widths().consecutive(0, advances);
    cid.finish();
    let bounds = face.global_bounding_box();
    pdf.font_descriptor(OBJECTS.descriptor)
        .name(FONT_NAME)
        .flags(FontFlags::SYMBOLIC)
        .bbox(Rect::new(
            per_em(bounds.x_min),
            per_em(bounds.y_min),
            per_em(bounds.x_max),
            per_em(bounds.y_max),
        ))
        .italic_angle(0.0)
        .ascent(per_em(face.ascender()))
        .descent(per_em(face.descender()))
        .cap_height(per_em(face.capital_height().unwrap_or(face.ascender())))
        .stem_v(80.0)
        .font_file2(OBJECTS.file);
    let subset = subsetter::subset(font::BYTES, 0, letters).map_err(|error| error.to_string())?;
    let mut file = pdf.stream(OBJECTS.file, &subset);
    file.pair(
        Name(b"Length1"),
        i32::try_from(subset.len()).unwrap_or(i32::MAX),
    );
    file.finish();
    let mut unicode = UnicodeCmap::new(FONT_NAME, SYSTEM);
    for (letter, character) in characters {
        unicode.pair(*letter, *character);
    }
    pdf.cmap(OBJECTS.unicode, &unicode.finish());
    Ok(())
}
