//! A page as PDF, with a subset of its font.

use super::font;
use super::origin::{Origin, PROGRAM};
use super::palette::Colour;
use super::scene::{Page, Place, Shape, Stroke, Text, single};
use pdf_writer::types::{
    CidFontType, FontFlags, LineCapStyle, LineJoinStyle, SystemInfo, UnicodeCmap,
};
use pdf_writer::{Content, Finish, Name, Pdf, Rect, Ref, Str, TextStr};
use std::collections::BTreeMap;
use subsetter::GlyphRemapper;
use tiny_skia::{Path, PathSegment, Transform};

const FONT: Name<'static> = Name(b"F1");
/// A prefix of six letters marks a subset of the font.
const FONT_NAME: Name<'static> = Name(b"SWEEPF+DejaVuSans");
const SYSTEM: SystemInfo<'static> = SystemInfo {
    registry: Str(b"Adobe"),
    ordering: Str(b"Identity"),
    supplement: 0,
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
    let [catalog, pages, leaf, content, font, info] = [1, 2, 3, 4, 5, 6].map(Ref::new);
    let mut pdf = Pdf::new();
    pdf.catalog(catalog).pages(pages);
    pdf.pages(pages).kids([leaf]).count(1);
    let mut leaf = pdf.page(leaf);
    leaf.media_box(Rect::new(0.0, 0.0, single(page.width), single(page.height)));
    leaf.parent(pages);
    leaf.contents(content);
    let mut resources = leaf.resources();
    resources.fonts().pair(FONT, font);
    let mut states = resources.ext_g_states();
    for (number, opacity) in writer.opacities.iter().enumerate() {
        let name = state_name(number);
        let mut state = states
            .insert(Name(name.as_bytes()))
            .start::<pdf_writer::writers::ExtGraphicsState<'_>>();
        state.non_stroking_alpha(*opacity);
    }
    states.finish();
    resources.finish();
    leaf.finish();
    pdf.stream(content, &writer.content.finish());
    write_font(&mut pdf, font, &writer.letters, &writer.characters)?;
    pdf.document_info(info)
        .title(TextStr(&origin.title))
        .subject(TextStr(&origin.text))
        .creator(TextStr(PROGRAM));
    Ok(pdf.finish())
}

/// The name of a degree of transparency.
fn state_name(number: usize) -> String {
    format!("G{number}")
}

fn channels(colour: Colour) -> [f32; 3] {
    colour.channels().map(|channel| f32::from(channel) / 255.0)
}

/// Writes the content of the page.
struct Writer {
    content: Content,
    height: f64,
    /// Glyphs that are used, by their new numbers.
    letters: GlyphRemapper,
    /// Characters by the new numbers of their glyphs.
    characters: BTreeMap<u16, char>,
    opacities: Vec<f32>,
}

impl Writer {
    fn draw(&mut self, shape: &Shape) -> Result<(), String> {
        match shape {
            Shape::Path { path, fill, stroke } => {
                self.content.save_state();
                if let Some((colour, opacity)) = fill {
                    self.fill(*colour);
                    self.opacity(*opacity);
                }
                if let Some(stroke) = stroke {
                    self.stroke(stroke);
                }
                self.path(path);
                match (fill, stroke) {
                    (Some(_), Some(_)) => self.content.fill_nonzero_and_stroke(),
                    (Some(_), None) => self.content.fill_nonzero(),
                    (None, Some(_)) => self.content.stroke(),
                    (None, None) => self.content.end_path(),
                };
                self.content.restore_state();
            }
            Shape::Text(text) => self.text(text)?,
            Shape::Within([from, to], shapes) => {
                let ([left, top], [right, bottom]) = (self.place(*from), self.place(*to));
                self.content
                    .save_state()
                    .rect(left, bottom, right - left, top - bottom)
                    .clip_nonzero()
                    .end_path();
                for shape in shapes {
                    self.draw(shape)?;
                }
                self.content.restore_state();
            }
        }
        Ok(())
    }

    fn fill(&mut self, colour: Colour) {
        let [red, green, blue] = channels(colour);
        self.content.set_fill_rgb(red, green, blue);
    }

    fn opacity(&mut self, opacity: f32) {
        if opacity < 1.0 {
            let known = self.opacities.iter().position(|known| *known == opacity);
            let number = known.unwrap_or(self.opacities.len());
            if known.is_none() {
                self.opacities.push(opacity);
            }
            let name = state_name(number);
            self.content.set_parameters(Name(name.as_bytes()));
        }
    }

    fn stroke(&mut self, stroke: &Stroke) {
        let [red, green, blue] = channels(stroke.colour);
        self.content.set_stroke_rgb(red, green, blue);
        self.content.set_line_width(single(stroke.width));
        self.content.set_line_join(LineJoinStyle::RoundJoin);
        if stroke.is_round {
            self.content.set_line_cap(LineCapStyle::RoundCap);
        }
        if let Some(dashes) = stroke.dashes {
            self.content.set_dash_pattern(dashes.map(single), 0.0);
        }
    }

    /// A point in the coordinates of PDF: y up.
    fn place(&self, [x, y]: Place) -> [f32; 2] {
        [single(x), single(self.height - y)]
    }

    fn path(&mut self, path: &Path) {
        let y_up = Transform::from_row(1.0, 0.0, 0.0, -1.0, 0.0, single(self.height));
        let content = &mut self.content;
        for segment in path.clone().transform(y_up).iter().flat_map(Path::segments) {
            match segment {
                PathSegment::MoveTo(to) => content.move_to(to.x, to.y),
                PathSegment::LineTo(to) => content.line_to(to.x, to.y),
                PathSegment::CubicTo(a, b, to) => content.cubic_to(a.x, a.y, b.x, b.y, to.x, to.y),
                PathSegment::QuadTo(control, to) => {
                    content.cubic_to_final(control.x, control.y, to.x, to.y)
                }
                PathSegment::Close => content.close_path(),
            };
        }
    }

    fn text(&mut self, text: &Text) -> Result<(), String> {
        let words = &text.words;
        let mut coded = Vec::with_capacity(2 * words.len());
        for character in words.chars() {
            let Some(glyph) = font::FACE.glyph_index(character) else {
                return Err(format!(
                    "the font of figures has no {character:?}, which {words:?} needs; SVG may show it"
                ));
            };
            let number = self.letters.remap(glyph.0);
            self.characters.insert(number, character);
            coded.extend(number.to_be_bytes());
        }
        let [x, y] = self.place(text.start());
        let matrix = if text.upright {
            [0.0, 1.0, -1.0, 0.0, x, y]
        } else {
            [1.0, 0.0, 0.0, 1.0, x, y]
        };
        self.fill(Colour::INK);
        self.content
            .begin_text()
            .set_font(FONT, single(text.size))
            .set_text_matrix(matrix)
            .show(Str(&coded))
            .end_text();
        Ok(())
    }
}

/// Writes the subset of the font, with widths and the map to characters.
fn write_font(
    pdf: &mut Pdf,
    font: Ref,
    letters: &GlyphRemapper,
    characters: &BTreeMap<u16, char>,
) -> Result<(), String> {
    let face = &font::FACE;
    let per_em = |units: i16| 1000.0 * f32::from(units) / f32::from(face.units_per_em());
    let [cid, descriptor, file, unicode] = [7, 8, 9, 10].map(Ref::new);
    pdf.type0_font(font)
        .base_font(FONT_NAME)
        .encoding_predefined(Name(b"Identity-H"))
        .descendant_font(cid)
        .to_unicode(unicode);
    let advances = letters
        .remapped_gids()
        .map(|glyph| single(1000.0 * font::advance(ttf_parser::GlyphId(glyph))));
    pdf.cid_font(cid)
        .subtype(CidFontType::Type2)
        .base_font(FONT_NAME)
        .system_info(SYSTEM)
        .font_descriptor(descriptor)
        .default_width(0.0)
        .cid_to_gid_map_predefined(Name(b"Identity"))
        .widths()
        .consecutive(0, advances);
    let bounds = face.global_bounding_box();
    let [left, bottom] = [bounds.x_min, bounds.y_min].map(per_em);
    let [right, top] = [bounds.x_max, bounds.y_max].map(per_em);
    pdf.font_descriptor(descriptor)
        .name(FONT_NAME)
        .flags(FontFlags::SYMBOLIC)
        .bbox(Rect::new(left, bottom, right, top))
        .italic_angle(0.0)
        .ascent(per_em(face.ascender()))
        .descent(per_em(face.descender()))
        .cap_height(per_em(face.capital_height().unwrap_or(face.ascender())))
        .stem_v(80.0)
        .font_file2(file);
    let subset = subsetter::subset(font::BYTES, 0, letters).map_err(|error| error.to_string())?;
    pdf.stream(file, &subset).pair(
        Name(b"Length1"),
        i32::try_from(subset.len()).unwrap_or(i32::MAX),
    );
    let mut map = UnicodeCmap::new(FONT_NAME, SYSTEM);
    for (letter, character) in characters {
        map.pair(*letter, *character);
    }
    pdf.cmap(unicode, &map.finish());
    Ok(())
}
