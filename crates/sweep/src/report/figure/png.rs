//! A page as PNG, which knows how large it is on paper.

use super::origin::Origin;
use super::shape::{Page, Shape};
use super::svg::{dots_per_unit, scene};
use kuva::backend::png::PngBackend;
use png::{BitDepth, ColorType, Decoder, Encoder, PixelDimensions, Transformations, Unit};
use std::io::Cursor;

/// The file, at so many dots per inch, with its origin.
pub(super) fn write(page: &Page, dpi: u32, origin: &Origin) -> Result<Vec<u8>, String> {
    let scale = dots_per_unit(dpi);
    #[expect(clippy::cast_possible_truncation, reason = "a scale of the backend")]
    let backend = PngBackend::new().with_scale(scale as f32);
    // The backend begins every segment of a line with a dash of its own: dashes are cut here.
    let shapes: Vec<Shape> = page.shapes.iter().flat_map(Shape::without_dashes).collect();
    let drawn = backend.render_scene(&scene(&shapes, page))?;
    with_size(&drawn, dpi, origin).map_err(|error| error.to_string())
}

/// The same picture with its size and origin.
fn with_size(
    drawn: &[u8],
    dpi: u32,
    origin: &Origin,
) -> Result<Vec<u8>, Box<dyn std::error::Error>> {
    let mut decoder = Decoder::new(Cursor::new(drawn));
    decoder.set_transformations(Transformations::normalize_to_color8());
    let mut reader = decoder.read_info()?;
    let mut dots = vec![
        0;
        reader
            .output_buffer_size()
            .ok_or("a picture without a size")?
    ];
    let info = reader.next_frame(&mut dots)?;
    dots.truncate(info.buffer_size());
    let colours = match info.color_type {
        // It hides what is behind it everywhere.
        ColorType::Rgba => {
            dots = dots
                .chunks_exact(4)
                .flat_map(|dot| [dot[0], dot[1], dot[2]])
                .collect();
            ColorType::Rgb
        }
        colours => colours,
    };
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, info.width, info.height);
    encoder.set_color(colours);
    encoder.set_depth(BitDepth::Eight);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "dots per metre"
    )]
    let per_metre = (f64::from(dpi) / 0.0254).round() as u32;
    encoder.set_pixel_dims(Some(PixelDimensions {
        xppu: per_metre,
        yppu: per_metre,
        unit: Unit::Meter,
    }));
    encoder.add_itxt_chunk("Title".into(), origin.title())?;
    encoder.add_itxt_chunk("Source".into(), origin.to_string())?;
    encoder.add_text_chunk("Software".into(), Origin::program())?;
    encoder.write_header()?.write_image_data(&dots)?;
    Ok(bytes)
}
