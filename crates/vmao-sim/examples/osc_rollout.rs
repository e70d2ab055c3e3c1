//! Simulates two Pandas under control for a while and prints what it did as JSON, for the comparison with a peer.
//!
//! Arguments: simulated seconds, object, seed.

#[path = "../tests/support/mod.rs"]
mod support;

use std::error::Error;
use vmao_core::catalogue::{InstanceSet, item};
use vmao_core::robots::panda;
use vmao_sim::throughput::random_rollout;
use vmao_sim::{Scene, profile};

#[expect(clippy::print_stdout, reason = "a measurement is printed")]
fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, seconds, object, seed] = arguments.as_slice() else {
        return Err("expected three arguments: simulated seconds, object, seed".into());
    };
    let (scene, trial) = support::configuration();
    let item = item(object, InstanceSet::Train, 0).ok_or("no such object in the catalogue")?;
    let scene = Scene::new(&scene, vec![panda(), panda()], item)?;
    profile::start();
    let rollout = random_rollout(&scene, trial.osc, &trial.start, seconds.parse()?, seed.parse()?);
    let [physics, control, ..] = profile::seconds().unwrap_or_default();
    println!(
        r#"{{"steps": {}, "contacts": {:.2}, "hand_paths": {:?}, "position_error": {:.6}, "rotation_error": {:.6}, "outside": {:.4}}}"#,
        rollout.steps,
        rollout.contacts,
        rollout.hand_paths,
        rollout.errors[0],
        rollout.errors[1],
        control / (physics + control),
    );
    Ok(())
}
