//! Images over surfaces: JPEG and PNG in, PNG out, bounded before anything is decoded.

use image::{ImageFormat, ImageReader, Limits, RgbaImage, codecs::png::PngEncoder};
use std::io::Cursor;

/// The largest image file that is read (bytes).
pub const MAX_BYTES: u64 = 32 << 20;
/// The most pixels along an edge.
pub const MAX_EDGE: u32 = 4096;
/// The most memory that decoding may take (bytes).
const MAX_MEMORY: u64 = 256 << 20;

/// A decoded image.
#[derive(Debug, Clone, PartialEq)]
pub struct Texture {
    pixels: RgbaImage,
    /// The format it came in.
    pub format: &'static str,
}

/// The image in `bytes`. Fails with what was found and what was expected.
pub fn read(bytes: &[u8]) -> Result<Texture, String> {
    let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|error| error.to_string())?;
    let format = match reader.format() {
        Some(ImageFormat::Png) => "PNG",
        Some(ImageFormat::Jpeg) => "JPEG",
        _ => return Err("neither a PNG nor a JPEG image".to_owned()),
    };
    // The decoder fills up what is missing of a JPEG; one that is whole ends with its marker, and little after it.
    let tail = &bytes[bytes.len().saturating_sub(4096)..];
    if format == "JPEG" && !tail.windows(2).any(|pair| pair == [0xff, 0xd9]) {
        return Err("not a whole JPEG image: its end is missing".to_owned());
    }
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_EDGE);
    limits.max_image_height = Some(MAX_EDGE);
    limits.max_alloc = Some(MAX_MEMORY);
    reader.limits(limits);
    let decoded =
        reader.decode().map_err(|error| format!("not a whole {format} image of at most {MAX_EDGE} by {MAX_EDGE}: {error}"))?;
    Ok(Texture { pixels: decoded.into_rgba8(), format })
}

impl Texture {
    /// How many pixels it has.
    pub fn pixel_count(&self) -> u64 {
        u64::from(self.pixels.width()) * u64::from(self.pixels.height())
    }

    /// The image as PNG.
    pub fn png(&self) -> Result<Vec<u8>, String> {
        let mut bytes = Vec::new();
        self.pixels.write_with_encoder(PngEncoder::new(&mut bytes)).map_err(|error| error.to_string())?;
        Ok(bytes)
    }

    /// The colour at texture coordinates, v upwards; the image repeats. Each of red, green, blue in [0, 1].
    pub fn color_at(&self, [u, v]: [f64; 2]) -> [f32; 3] {
        let (width, height) = self.pixels.dimensions();
        let pixel = |share: f64, count: u32| ((share.rem_euclid(1.0) * f64::from(count)) as u32).min(count - 1);
        let [r, g, b, _] = self.pixels.get_pixel(pixel(u, width), pixel(1.0 - v, height)).0;
        [r, g, b].map(|value| f32::from(value) / 255.0)
    }

    /// The mean colour of all pixels, each in [0, 1].
    pub fn mean_color(&self) -> [f32; 3] {
        let mut sum = [0_u64; 3];
        for pixel in self.pixels.pixels() {
            for (sum, value) in sum.iter_mut().zip(pixel.0) {
                *sum += u64::from(value);
            }
        }
        let count = self.pixels.pixels().len().max(1) as f64;
        sum.map(|sum| (sum as f64 / count / 255.0) as f32)
    }
}
