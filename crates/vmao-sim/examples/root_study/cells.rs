//! What the study runs on: objects, arms and orders, each with every part as dependency root.

use std::error::Error;
use vmao_core::catalogue::{INSTANCES, InstanceSet, item};
use vmao_core::order::GraspOrder;
use vmao_core::robots::panda;
use vmao_sim::{Layout, Scene, SceneConfig};

/// One object held by Pandas in one order.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cell {
    pub(crate) object: &'static str,
    pub(crate) layout: Layout,
    pub(crate) order: GraspOrder,
}

const fn cell(object: &'static str, layout: Layout, order: GraspOrder) -> Cell {
    Cell { object, layout, order }
}

/// Two levers on one pin, a hinge at an edge, a chain, a frame with two branches, a body with a hinge and a slide.
pub(crate) const CELLS: [Cell; 10] = [
    cell("pliers", Layout::Opposed, GraspOrder::Parallel),
    cell("pliers", Layout::Opposed, GraspOrder::Sequential),
    cell("laptop", Layout::Opposed, GraspOrder::Parallel),
    cell("laptop", Layout::Opposed, GraspOrder::Sequential),
    cell("three-sticks-chain", Layout::Ring, GraspOrder::Parallel),
    cell("three-sticks-chain", Layout::Ring, GraspOrder::Sequential),
    cell("eyeglasses", Layout::Ring, GraspOrder::Parallel),
    cell("eyeglasses", Layout::Ring, GraspOrder::Sequential),
    cell("cabinet", Layout::Ring, GraspOrder::Parallel),
    cell("cabinet", Layout::Ring, GraspOrder::Sequential),
];

impl Cell {
    /// `pliers-parallel`
    pub(crate) fn name(&self) -> String {
        format!("{}-{}", self.object, self.order.name())
    }

    /// The names of the object's parts.
    pub(crate) fn roots(&self) -> Result<Vec<String>, Box<dyn Error>> {
        let item = item(self.object, InstanceSet::Train, 0).ok_or("no such object")?;
        Ok(item.object.parts.into_iter().map(|part| part.name).collect())
    }

    /// The scene of each size with this root.
    pub(crate) fn scenes(&self, physics: &SceneConfig, set: InstanceSet, root: &str) -> Result<Vec<Scene>, Box<dyn Error>> {
        let physics = SceneConfig { layout: self.layout, ..physics.clone() };
        let scene = |instance| -> Result<Scene, Box<dyn Error>> {
            let item = item(self.object, set, instance).ok_or("no such object")?;
            let arms = vec![panda(); item.object.parts.len()];
            Ok(Scene::new(&physics, arms, item)?.with_root(root)?)
        };
        (0..INSTANCES).map(scene).collect()
    }
}
