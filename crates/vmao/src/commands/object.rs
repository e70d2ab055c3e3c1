//! `vmao object list` and `vmao object show NAME`: the catalogue.

use super::{CommonOptions, Session};
use crate::{failure::Failure, wording::unknown};
use serde_json::{Value, json};
use vmao_core::catalogue::{self, INSTANCES, InstanceSet};
use vmao_core::contact::PartId;
use vmao_core::object_graph::ObjectGraph;

#[derive(Debug, clap::Args)]
pub(super) struct ObjectArguments {
    #[command(subcommand)]
    pub(super) action: Action,
}

#[derive(Debug, clap::Subcommand)]
pub(super) enum Action {
    /// Names of all objects
    List {
        #[command(flatten)]
        common: CommonOptions,
    },
    /// Parts, joints, limits, masses and dependency graph of one object
    Show {
        /// Its name
        name: String,
        #[command(flatten)]
        common: CommonOptions,
    },
}

impl Action {
    pub(super) fn common(&self) -> &CommonOptions {
        match self {
            Self::List { common } | Self::Show { common, .. } => common,
        }
    }
}

pub(super) fn run(arguments: &ObjectArguments, session: &Session) -> Result<(), Failure> {
    match &arguments.action {
        Action::List { .. } => session.print(&catalogue::NAMES),
        Action::Show { name, .. } => session.print(&description(name)?),
    }
}

fn description(name: &str) -> Result<Value, Failure> {
    let refuse = || Failure::bad_input(unknown("the catalogue", "object", name, catalogue::NAMES));
    let item = catalogue::item(name, InstanceSet::Train, 0).ok_or_else(refuse)?;
    let object = &item.object;
    let part = |id: PartId| &object.parts[usize::from(id.0)].name;
    let graph = ObjectGraph::of(object)?;
    let dependencies: Vec<Value> =
        graph.outward(PartId(0)).iter().map(|step| json!({ "part": part(step.to), "depends_on": part(step.from) })).collect();
    Ok(json!({
        "name": object.name,
        "sizes": { "train": INSTANCES, "held_out": INSTANCES },
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
    }))
}
