//! From a configuration to compiled scenes: one for each size of the object.

use crate::config::Config;
use crate::failure::Failure;
use crate::wording::unknown;
use vmao_core::catalogue::{self, CatalogueItem, INSTANCES, InstanceSet};
use vmao_core::robots::{RobotModel, sawyer};
use vmao_sim::{Error, Scene};

/// The configured object in every size of `set`. An unknown name is bad input.
pub fn items(config: &Config, set: InstanceSet) -> Result<Vec<CatalogueItem>, Failure> {
    let name = &config.object.name;
    let item = |instance| catalogue::item(name, set, instance);
    let unknown = || Failure::bad_input(unknown("the catalogue", "object", name, catalogue::NAMES));
    (0..INSTANCES).map(|instance| item(instance).ok_or_else(unknown)).collect()
}

/// Grasps of a trial, one for each part of the configured object; arms beyond them stand by.
pub fn grasps(config: &Config) -> Result<usize, Failure> {
    Ok(items(config, InstanceSet::Train)?.iter().map(|item| item.object.parts.len()).max().unwrap_or(0))
}

/// Compiles the configured scene for every size in `set`. Unknown names and too few or many arms are bad input.
pub fn scenes(config: &Config, set: InstanceSet) -> Result<Vec<Scene>, Failure> {
    let robot = |name: &String| match name.as_str() {
        "sawyer" => Ok(sawyer(config.robots.sawyer_slot)),
        _ => RobotModel::named(name).ok_or_else(|| Failure::bad_input(unknown("the program", "robot", name, RobotModel::NAMES))),
    };
    let robots = config.robots.names.iter().map(robot).collect::<Result<Vec<_>, _>>()?;
    let compile = |item: CatalogueItem| {
        let (arms, parts) = (robots.len(), item.object.parts.len());
        if arms < parts {
            let object = &item.object.name;
            let message = format!("robots.names: {arms} arms, expected at least {parts}: one for each part of `{object}`");
            return Err(Failure::bad_input(message));
        }
        let scene = Scene::new(&config.scene, robots.clone(), item).map_err(|error| match error {
            Error::Placement { cause } => Failure::bad_input(format!("scene.layout: {cause}")),
            other => other.into(),
        })?;
        scene.with_root(&config.object.root).map_err(|error| Failure::bad_input(format!("object.root: {error}")))
    };
    items(config, set)?.into_iter().map(compile).collect()
}
