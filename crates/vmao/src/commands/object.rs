//! `vmao object list` and `vmao object show NAME`: the catalogue, and objects from files.

use super::{
    CommonOptions, Session,
    object_import::{self, ImportArguments},
};
use crate::{
    failure::{Failure, OrBadInput},
    inputs::{is_path, read_object},
    wording::{quoted, unknown},
};
use serde_json::{Map, Value, json};
use std::{
    fs,
    path::{Path, PathBuf},
};
use vmao_core::antipodal;
use vmao_core::catalogue::{self, CatalogueItem, INSTANCES, InstanceSet, widths_held};
use vmao_core::contact::PartId;
use vmao_core::object_file::FILE_NAME;
use vmao_core::object_graph::ObjectGraph;
use vmao_core::robots::RobotModel;

#[derive(Debug, clap::Args)]
pub(super) struct ObjectArguments {
    #[command(subcommand)]
    pub(super) action: Action,
}

#[derive(Debug, clap::Subcommand)]
pub(super) enum Action {
    /// Names of all objects of the catalogue, or the paths of all in a folder
    List {
        /// A folder of object files or of folders of them
        folder: Option<PathBuf>,
        #[command(flatten)]
        common: CommonOptions,
    },
    /// A PartNet-Mobility folder, a URDF or an MJCF file becomes an object that can be simulated
    ///
    /// Writes object.json, repairs.json and the pictures' meshes to --out, which must not be there yet.
    /// docs/import.md says what is read, repaired and refused.
    Import(Box<ImportArguments>),
    /// Parts, joints, limits, masses and dependency graph of one object
    Show {
        /// Its name, or the path of its file or folder (with a `/`)
        name: String,
        #[command(flatten)]
        common: CommonOptions,
    },
}

impl Action {
    pub(super) fn common(&self) -> &CommonOptions {
        match self {
            Self::Import(arguments) => &arguments.common,
            Self::List { common, .. } | Self::Show { common, .. } => common,
        }
    }
}

pub(super) fn run(arguments: &ObjectArguments, session: &Session) -> Result<(), Failure> {
    match &arguments.action {
        Action::Import(arguments) => object_import::run(arguments, session),
        Action::List { folder: None, .. } => session.print(&catalogue::NAMES),
        Action::List { folder: Some(folder), .. } => session.print(&files(folder)?),
        Action::Show { name, .. } => session.print(&description(name)?),
    }
}

/// The object files of a folder, sorted: its own, and those of its folders.
fn files(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let refuse = |error: std::io::Error| Failure::bad_input(format!("{}: cannot be read: {error}", folder.display()));
    let entries = fs::read_dir(folder).map_err(refuse)?;
    let folders = entries.filter_map(|entry| Some(entry.ok()?.path())).chain([folder.to_owned()]);
    let mut files: Vec<PathBuf> = folders.map(|folder| folder.join(FILE_NAME)).filter(|file| file.is_file()).collect();
    files.sort();
    Ok(files)
}

/// Every size of the object with its label, those explored first.
fn sizes(name: &str) -> Result<Vec<(String, CatalogueItem)>, Failure> {
    if is_path(name) {
        let (item, _) = read_object(Path::new(name)).or_bad_input()?;
        return Ok(vec![("the file's".to_owned(), item)]);
    }
    let sets = [("train", InstanceSet::Train), ("held-out", InstanceSet::HeldOut)].into_iter();
    let numbered =
        sets.flat_map(|(label, set)| (0..INSTANCES).map(move |instance| (format!("{label} {instance}"), set, instance)));
    let item = |(label, set, instance)| Some((label, catalogue::item(name, set, instance)?));
    let refuse = || Failure::bad_input(unknown("the catalogue", "object", name, catalogue::NAMES));
    numbered.map(|size| item(size).ok_or_else(refuse)).collect()
}

fn description(name: &str) -> Result<Value, Failure> {
    let sizes = sizes(name)?;
    let (_, item) = &sizes[0];
    let object = &item.object;
    let of_each = if is_path(name) { [1, 0] } else { [INSTANCES; 2] };
    let part = |id: PartId| &object.parts[usize::from(id.0)].name;
    let graph = ObjectGraph::of(object)?;
    let dependencies: Vec<Value> =
        graph.outward(PartId(0)).iter().map(|step| json!({ "part": part(step.to), "depends_on": part(step.from) })).collect();
    Ok(json!({
        "name": object.name,
        "sizes": { "train": of_each[0], "held_out": of_each[1] },
        "parts": object.parts.iter().map(|part| json!({ "name": part.name, "mass": part.mass })).collect::<Vec<_>>(),
        "joints": object.joints.iter().map(|joint| json!({
            "name": joint.name,
            "type": joint.kind,
            "parent": part(joint.parent),
            "child": part(joint.child),
            "anchor": joint.anchor,
            "axis": joint.axis,
            "limits": joint.limits,
            "damping": joint.damping,
            "friction": joint.friction,
        })).collect::<Vec<_>>(),
        "root": part(PartId(0)),
        "dependencies": dependencies,
        "demonstrations": item.demonstrations.len(),
        "grippers": grippers(&sizes),
    }))
}

/// For each robot: of how many sizes its gripper can hold every part, and why not of the others.
fn grippers(sizes: &[(String, CatalogueItem)]) -> Map<String, Value> {
    let robots = RobotModel::NAMES.into_iter().filter_map(RobotModel::named);
    robots.map(|robot| (robot.name.to_owned(), suits(&robot, sizes))).collect()
}

fn suits(robot: &RobotModel, sizes: &[(String, CatalogueItem)]) -> Value {
    let millimetres = |metres: f64| (metres * 1e4).round() / 10.0;
    let [least, greatest] = widths_held(&robot.gripper).map(millimetres);
    let mut refused = Vec::new();
    for (label, item) in sizes {
        if item.demonstrations.is_empty() {
            if antipodal::demonstrations(&item.object, std::slice::from_ref(robot), 1).is_empty() {
                refused.push(json!({ "size": label, "reasons": ["no way found to hold every part"] }));
            }
            continue;
        }
        let reasons: Vec<String> = item
            .misfits(&robot.gripper)
            .iter()
            .map(|misfit| {
                let part = quoted(&item.object.parts[usize::from(misfit.part.0)].name);
                let [narrow, wide] = misfit.widths.map(millimetres);
                format!("part {part} is {narrow} to {wide} mm wide where it is held, the gripper takes {least} to {greatest} mm")
            })
            .collect();
        if !reasons.is_empty() {
            refused.push(json!({ "size": label, "reasons": reasons }));
        }
    }
    json!({ "sizes_held": sizes.len() - refused.len(), "sizes": sizes.len(), "refused": refused })
}
