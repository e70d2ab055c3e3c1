//! Draws the contact sheet of the catalogue and prints its table, as they stand in `docs/catalogue.md`:
//! `cargo run -p vmao-sim --example catalogue_sheet -- docs/catalogue.png`.

#[path = "../tests/support/mod.rs"]
mod support;

use std::error::Error;
use std::fs::File;
use std::io::BufWriter;
use vmao_core::catalogue::{CatalogueItem, INSTANCES, InstanceSet, NAMES, item};
use vmao_core::object::JointKind;
use vmao_core::robots::RobotModel;
use vmao_sim::{Picture, portrait};

const COLUMNS: usize = 5;
/// Of each object's picture (pixels).
const TILE: [usize; 2] = [250, 200];
/// Size of a dot of the letters (pixels).
const DOT: usize = 2;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("expected the path of the picture to write")?;
    let (scene, _) = support::configuration();
    let [width, height] = TILE;
    let rows = NAMES.len().div_ceil(COLUMNS);
    let mut sheet =
        Picture { width: COLUMNS * width, height: rows * height, pixels: vec![[255; 3]; COLUMNS * width * rows * height] };
    for (index, name) in NAMES.into_iter().enumerate() {
        let item = item(name, InstanceSet::Train, 0).ok_or("a name that is no object")?;
        let tile = portrait(&scene, item, width - 2, height - 2)?;
        let (left, top) = (index % COLUMNS * width + 1, index / COLUMNS * height + 1);
        for (row, pixels) in tile.pixels.chunks(tile.width).enumerate() {
            let start = (top + row) * sheet.width + left;
            sheet.pixels[start..start + tile.width].copy_from_slice(pixels);
        }
        write_name(&mut sheet, left + 8, top + 8, name);
    }
    print_table();
    save(&sheet, &path)
}

/// Smallest and largest of the values, in the unit of which `scale` make one.
fn span(values: impl Iterator<Item = f64>, scale: f64, decimals: usize) -> String {
    let (low, high) = values.fold((f64::INFINITY, 0.0_f64), |(low, high), value| (low.min(value), high.max(value)));
    format!("{:.decimals$} to {:.decimals$}", low * scale, high * scale)
}

#[expect(clippy::print_stdout, reason = "the table goes where the user wants it")]
fn print_table() {
    let robots = RobotModel::NAMES.map(|name| (name, RobotModel::named(name)));
    println!(
        "| object | parts | joints, range | mass (g) | held across (mm) | {} |",
        robots.each_ref().map(|robot| robot.0).join(" | ")
    );
    println!("|---|---|---|---|---|{}", "---|".repeat(robots.len()));
    for name in NAMES {
        let sets = [InstanceSet::Train, InstanceSet::HeldOut].into_iter();
        let sizes: Vec<CatalogueItem> =
            sets.flat_map(|set| (0..INSTANCES).filter_map(move |instance| item(name, set, instance))).collect();
        let object = &sizes[0].object;
        let parts: Vec<&str> = object.parts.iter().map(|part| &*part.name).collect();
        let joint = |index: usize| {
            let joint = &object.joints[index];
            let ranges = sizes.iter().filter_map(|size| size.object.joints[index].limits).map(|[low, high]| high - low);
            let range = match joint.kind {
                JointKind::Revolute | JointKind::Ball => format!("{:.0}°", ranges.fold(0.0, f64::max).to_degrees()),
                JointKind::Prismatic => format!("{} mm", span(ranges, 1e3, 0)),
                JointKind::Fixed => String::new(),
            };
            format!("{} {} {range}", joint.kind.name(), joint.name)
        };
        let joints: Vec<String> = (0..object.joints.len()).map(joint).collect();
        let masses = sizes.iter().map(|size| size.object.parts.iter().map(|part| part.mass).sum());
        let widths = sizes.iter().flat_map(|size| size.demonstrations.iter().flatten()).map(|contact| contact.width());
        let held = |robot: &(&str, Option<RobotModel>)| {
            let suits = |size: &&CatalogueItem| robot.1.as_ref().is_some_and(|robot| size.misfits(&robot.gripper).is_empty());
            format!("{} of {}", sizes.iter().filter(suits).count(), sizes.len())
        };
        println!(
            "| `{name}` | {} | {} | {} | {} | {} |",
            parts.join(", "),
            joints.join(", "),
            span(masses, 1e3, 0),
            span(widths, 1e3, 1),
            robots.each_ref().map(held).join(" | ")
        );
    }
}

/// Letters of three by five dots: the rows from the top, three bits each.
fn glyph(letter: char) -> [u8; 5] {
    match letter {
        'a' => [2, 5, 7, 5, 5],
        'b' => [6, 5, 6, 5, 6],
        'c' => [3, 4, 4, 4, 3],
        'd' => [6, 5, 5, 5, 6],
        'e' => [7, 4, 6, 4, 7],
        'f' => [7, 4, 6, 4, 4],
        'g' => [3, 4, 5, 5, 3],
        'h' => [5, 5, 7, 5, 5],
        'i' => [7, 2, 2, 2, 7],
        'k' => [5, 5, 6, 5, 5],
        'l' => [4, 4, 4, 4, 7],
        'n' => [6, 5, 5, 5, 5],
        'o' => [2, 5, 5, 5, 2],
        'p' => [6, 5, 6, 4, 4],
        'r' => [6, 5, 6, 5, 5],
        's' => [3, 4, 2, 1, 6],
        't' => [7, 2, 2, 2, 2],
        'w' => [5, 5, 7, 7, 5],
        'x' => [5, 5, 2, 5, 5],
        'y' => [5, 5, 2, 2, 2],
        '2' => [6, 1, 2, 4, 7],
        '3' => [6, 1, 2, 1, 6],
        '4' => [5, 5, 7, 1, 1],
        '5' => [7, 4, 6, 1, 6],
        '6' => [3, 4, 6, 5, 2],
        '-' => [0, 0, 7, 0, 0],
        // A letter that no name has yet shows as a full block.
        _ => [7; 5],
    }
}

fn write_name(sheet: &mut Picture, left: usize, top: usize, name: &str) {
    for (place, letter) in name.chars().enumerate() {
        for (row, bits) in glyph(letter).into_iter().enumerate() {
            for column in (0..3).filter(|column| bits >> (2 - column) & 1 == 1) {
                for dot in 0..DOT * DOT {
                    let x = left + (4 * place + column) * DOT + dot % DOT;
                    let y = top + row * DOT + dot / DOT;
                    sheet.pixels[y * sheet.width + x] = [30, 30, 34];
                }
            }
        }
    }
}

fn save(sheet: &Picture, path: &str) -> Result<(), Box<dyn Error>> {
    let file = BufWriter::new(File::create(path)?);
    let mut encoder = png::Encoder::new(file, sheet.width as u32, sheet.height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(sheet.pixels.as_flattened())?;
    Ok(writer.finish()?)
}
