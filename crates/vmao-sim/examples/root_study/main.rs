//! The study of the dependency root in `docs/dependency-root.md`: the same trials with every part as root.
//!
//! `cargo run --release -p vmao-sim --example root_study -- run DIR held-out 300 pliers-parallel` runs what is missing of 300
//! trials, in order and resumable; `tables DIR held-out 0` prints them from trial 0 on, `figures DIR held-out docs` draws the pictures.

#[path = "../../tests/support/mod.rs"]
mod support;

mod cells;
mod figures;
mod run;
mod study;
mod tables;

use std::error::Error;
use vmao_core::catalogue::InstanceSet;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
        ["run", directory, sizes, trials, names @ ..] => {
            for name in names {
                let cell = cells::CELLS.iter().find(|cell| cell.name() == **name);
                run::run(directory, cell.ok_or_else(|| format!("no cell {name}"))?, set(sizes)?, trials.parse()?)?;
            }
            Ok(())
        }
        ["tables", directory, sizes, first] => tables::print(directory, set(sizes)?, first.parse()?),
        ["figures", directory, sizes, folder] => figures::write(directory, set(sizes)?, folder),
        _ => Err("expected: run DIR SIZES TRIALS CELL..., tables DIR SIZES FIRST, or figures DIR SIZES FOLDER".into()),
    }
}

fn set(name: &str) -> Result<InstanceSet, Box<dyn Error>> {
    match name {
        "train" => Ok(InstanceSet::Train),
        "held-out" => Ok(InstanceSet::HeldOut),
        _ => Err(format!("sizes `{name}`, expected train or held-out").into()),
    }
}
