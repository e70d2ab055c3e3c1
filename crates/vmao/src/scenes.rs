//! From a configuration to compiled scenes: one for each size of the object.

use crate::config::{Config, Demonstrations};
use crate::demonstrations::fitted;
use crate::failure::Failure;
use crate::inputs::is_path;
use crate::wording::unknown;
use vmao_core::antipodal;
use vmao_core::catalogue::{self, CatalogueItem, INSTANCES, InstanceSet};
use vmao_core::robots::{RobotModel, sawyer};
use vmao_sim::{Error, Scene};

/// Demonstrations made for an object that has none.
const FOUND: usize = 8;

/// The configured object in every size of `set`, with the configured demonstrations. An unknown name is bad input.
pub fn items(config: &Config, set: InstanceSet) -> Result<Vec<CatalogueItem>, Failure> {
    let items = plain_items(config, set)?;
    match config.demonstrations() {
        Demonstrations::Own if items.iter().all(|item| !item.demonstrations.is_empty()) => Ok(items),
        Demonstrations::Own | Demonstrations::Found => found(config, items),
        Demonstrations::File(name) => {
            let refuse = |message: String| Failure::bad_input(format!("explore.demonstrations: {name}: {message}"));
            let first = plain_items(config, InstanceSet::Train)?.into_iter().next().ok_or_else(|| refuse("no object".into()))?;
            let file = config.inputs.demonstrations(&name).ok_or_else(|| refuse("not read".into()))?;
            let tuples = file.tuples(&first).map_err(refuse)?;
            let fit = |(size, item): (usize, CatalogueItem)| match fitted(&tuples, &item) {
                tuples if tuples.is_empty() => {
                    Err(refuse(format!("no demonstration meets size {size} of `{}`", first.object.name)))
                }
                demonstrations => Ok(CatalogueItem { demonstrations, ..item }),
            };
            items.into_iter().enumerate().map(fit).collect()
        }
    }
}

/// The items with demonstrations found from their shapes.
fn found(config: &Config, items: Vec<CatalogueItem>) -> Result<Vec<CatalogueItem>, Failure> {
    let robots = distinct(robots(config)?);
    let find = |item: CatalogueItem| {
        let demonstrations = antipodal::demonstrations(&item.object, &robots, FOUND);
        if demonstrations.is_empty() {
            let names: Vec<&str> = robots.iter().map(|robot| robot.name).collect();
            let message = format!("object.name: no way found to hold every part of `{}` with the grippers of", item.object.name);
            return Err(Failure::bad_input(format!("{message} {}; explore.demonstrations takes a file", names.join(" and "))));
        }
        Ok(CatalogueItem { demonstrations, ..item })
    };
    items.into_iter().map(find).collect()
}

fn distinct(mut robots: Vec<RobotModel>) -> Vec<RobotModel> {
    robots.sort_by_key(|robot| robot.name);
    robots.dedup_by_key(|robot| robot.name);
    robots
}

fn plain_items(config: &Config, set: InstanceSet) -> Result<Vec<CatalogueItem>, Failure> {
    let name = &config.object.name;
    if is_path(name) {
        let explored = || [name].into_iter().chain(&config.object.sizes);
        let held_out = &config.object.held_out;
        let names: Vec<&String> = match set {
            InstanceSet::HeldOut if !held_out.is_empty() => held_out.iter().collect(),
            InstanceSet::Train | InstanceSet::HeldOut => explored().collect(),
        };
        let item = |name: &String| {
            let item = config.inputs.object(name).cloned();
            item.ok_or_else(|| Failure::bad_input(format!("{name}: not an object file")))
        };
        return names.into_iter().map(item).collect();
    }
    let item = |instance| catalogue::item(name, set, instance);
    let unknown = || Failure::bad_input(unknown("the catalogue", "object", name, catalogue::NAMES));
    (0..INSTANCES).map(|instance| item(instance).ok_or_else(unknown)).collect()
}

/// Grasps of a trial, one for each part of the configured object; arms beyond them stand by.
pub fn grasps(config: &Config) -> Result<usize, Failure> {
    Ok(plain_items(config, InstanceSet::Train)?.iter().map(|item| item.object.parts.len()).max().unwrap_or(0))
}

fn robots(config: &Config) -> Result<Vec<RobotModel>, Failure> {
    let robot = |name: &String| match name.as_str() {
        "sawyer" => Ok(sawyer(config.robots.sawyer_slot)),
        _ => RobotModel::named(name).ok_or_else(|| Failure::bad_input(unknown("the program", "robot", name, RobotModel::NAMES))),
    };
    config.robots.names.iter().map(robot).collect()
}

/// Compiles the configured scene for every size in `set`. Unknown names and too few or many arms are bad input.
pub fn scenes(config: &Config, set: InstanceSet) -> Result<Vec<Scene>, Failure> {
    let robots = robots(config)?;
    let check = |item: &CatalogueItem| {
        let (arms, parts) = (robots.len(), item.object.parts.len());
        if arms < parts {
            let object = &item.object.name;
            let message = format!("robots.names: {arms} arms, expected at least {parts}: one for each part of `{object}`");
            return Err(Failure::bad_input(message));
        }
        Ok(())
    };
    plain_items(config, set)?.iter().try_for_each(check)?;
    let compile = |item: CatalogueItem| {
        let scene = Scene::new(&config.scene, robots.clone(), item).map_err(|error| match error {
            Error::Placement { cause } => Failure::bad_input(format!("scene.layout: {cause}")),
            other => other.into(),
        })?;
        scene.with_root(&config.object.root).map_err(|error| Failure::bad_input(format!("object.root: {error}")))
    };
    items(config, set)?.into_iter().map(compile).collect()
}
