//! The study of the dependency root in `docs/dependency-root.md`: the same trials with every part as root.
//! `cargo run --release -p vmao-sim --example root_study -- run DIR held-out 300 pliers-parallel` runs what is missing.

#[path = "../../tests/support/mod.rs"]
mod support;

mod cells;
mod run;

use std::error::Error;
use vmao_core::catalogue::InstanceSet;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
        ["run", directory, set, trials, names @ ..] => {
            let set = match *set {
                "train" => InstanceSet::Train,
                "held-out" => InstanceSet::HeldOut,
                _ => return Err(format!("sizes `{set}`, expected train or held-out").into()),
            };
            for name in names {
                let cell = cells::CELLS.iter().find(|cell| cell.name() == **name);
                run::run(directory, cell.ok_or_else(|| format!("no cell {name}"))?, set, trials.parse()?)?;
            }
            Ok(())
        }
        _ => Err("expected: run DIR train|held-out TRIALS CELL...".into()),
    }
}
