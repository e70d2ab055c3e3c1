//! Pictures put together and written as PNG with a palette.

use super::palette::Palette;
use std::io::{self, Write};
use vmao_sim::Picture;

/// Pixels between the pictures of a sheet.
const GAP: usize = 4;

/// Pictures in rows on white; each column is as wide and each row as high as its largest.
pub(crate) fn sheet(rows: &[Vec<Picture>]) -> Picture {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let wide = |column: usize| rows.iter().filter_map(|row| row.get(column)).map(|tile| tile.width).max().unwrap_or(0);
    let high = |row: &[Picture]| row.iter().map(|tile| tile.height).max().unwrap_or(0);
    let width = (0..columns).map(|column| wide(column) + GAP).sum::<usize>().saturating_sub(GAP);
    let height = rows.iter().map(|row| high(row) + GAP).sum::<usize>().saturating_sub(GAP);
    let mut sheet = Picture { width, height, pixels: vec![[255; 3]; width * height] };
    let mut top = 0;
    for row in rows {
        let mut left = 0;
        for (column, tile) in row.iter().enumerate() {
            for (line, pixels) in tile.pixels.chunks(tile.width.max(1)).enumerate() {
                let start = (top + line) * width + left;
                sheet.pixels[start..start + tile.width].copy_from_slice(pixels);
            }
            left += wide(column) + GAP;
        }
        top += high(row) + GAP;
    }
    sheet
}

/// Writes a picture in at most 255 colours.
pub(crate) fn save(picture: &Picture, out: impl Write) -> io::Result<()> {
    let palette = Palette::of([picture].into_iter(), 255);
    let mut encoder = png::Encoder::new(out, picture.width as u32, picture.height as u32);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_palette(palette.colors.as_flattened().to_vec());
    encoder.set_compression(png::Compression::High);
    let mut writer = encoder.write_header().map_err(io::Error::other)?;
    writer.write_image_data(&palette.indices(picture)).map_err(io::Error::other)?;
    writer.finish().map_err(io::Error::other)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sheet_keeps_rows_and_columns_apart_and_reads_back() {
        let tile = |color: [u8; 3], width: usize| Picture { width, height: 5, pixels: vec![color; 5 * width] };
        let sheet = sheet(&[vec![tile([200, 0, 0], 6), tile([0, 200, 0], 3)], vec![tile([0, 0, 200], 4)]]);
        assert_eq!((sheet.width, sheet.height), (6 + GAP + 3, 10 + GAP));
        assert_eq!(sheet.pixels[0], [200, 0, 0]);
        assert_eq!(sheet.pixels[6 + GAP], [0, 200, 0]);
        assert_eq!(sheet.pixels[(5 + GAP) * sheet.width], [0, 0, 200]);
        assert_eq!(sheet.pixels[6], [255; 3]);
        let mut bytes = Vec::new();
        save(&sheet, &mut bytes).unwrap();
        let mut decoder = png::Decoder::new(io::Cursor::new(bytes));
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().unwrap();
        let mut back = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut back).unwrap();
        assert_eq!(back, sheet.pixels.as_flattened());
    }
}
