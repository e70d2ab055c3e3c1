//! Tests that look inside a running simulation. Those that need only the public interface are in `tests/`.

mod cameras;
mod catalogue;
mod control;
mod dependency_root;
mod grips;
mod hulls;
mod imported;
mod internal_forces;
mod inverse_kinematics;
mod kinematics;
mod link_meshes;
mod object_trees;
mod rays;
mod reachability;
mod runaways;
mod second_looks;
mod starts_and_goals;
#[path = "../../tests/support/mod.rs"]
mod support;
mod witness;

use crate::scene::Scene;
use crate::simulation::Simulation;
use crate::task::sample_start;
use std::cell::RefCell;
use vmao_core::random::Stream;

type Observer = Box<dyn FnMut(&Simulation<'_>)>;

thread_local! {
    static OBSERVER: RefCell<Option<Observer>> = const { RefCell::new(None) };
}

/// Called by every tick of every simulation of this thread.
pub(crate) fn after_tick(simulation: &Simulation<'_>) {
    OBSERVER.with_borrow_mut(|observer| {
        if let Some(observer) = observer {
            observer(simulation);
        }
    });
}

/// Runs `run` while `observer` sees the state after every tick.
fn observed<R>(observer: impl FnMut(&Simulation<'_>) + 'static, run: impl FnOnce() -> R) -> R {
    OBSERVER.set(Some(Box::new(observer)));
    let result = run();
    OBSERVER.set(None);
    result
}

/// A simulation whose object has come to rest where trial `index` would start.
fn settled(scene: &Scene, index: u64) -> Simulation<'_> {
    let (_, config) = support::configuration();
    let (world_from_root, joints) = sample_start(scene, &config.start, &mut Stream::new(support::SEED, &[index]));
    let mut simulation = Simulation::new(scene, config.osc, &world_from_root, &joints);
    simulation.wait(0.6);
    simulation
}
