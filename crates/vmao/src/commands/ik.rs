//! `vmao ik --robot R --frame F FILE`: inverse kinematics. A table for people, JSON with `--json`.

use super::{CommonOptions, Session};
use crate::{
    failure::{Failure, OrBadInput},
    ik::{Answer, Reason, Wanted, answer},
    json::Document,
    output::{Layout, print, write_whole},
    wording::unknown,
};
use anyhow::Context;
use std::{io::Write, path::PathBuf};
use vmao_core::{
    inverse_kinematics::{IkSettings, InverseKinematics},
    robots::RobotModel,
};

#[derive(Debug, clap::Args)]
pub(super) struct IkArguments {
    /// The request, a JSON document; - for standard input
    #[arg(value_name = "FILE")]
    request: PathBuf,
    /// The robot: panda, sawyer
    #[arg(long, value_name = "NAME")]
    robot: String,
    /// What the targets are poses of
    #[arg(long)]
    frame: Frame,
    /// Answer with one solution of every branch as well
    #[arg(long)]
    all: bool,
    #[command(flatten)]
    pub(super) common: CommonOptions,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Frame {
    /// Where a gripper is mounted: Panda's link8, Sawyer's `right_hand`
    Flange,
    /// The point between the finger pads; z approaches, y closes
    Tool,
}

pub(super) fn run(arguments: &IkArguments, session: &Session) -> Result<(), Failure> {
    let missing = || Failure::bad_input(unknown("the program", "robot", &arguments.robot, RobotModel::NAMES));
    let robot = RobotModel::named(&arguments.robot).ok_or_else(missing)?;
    let document = Document::read(&arguments.request).or_bad_input()?;
    let chain = match arguments.frame {
        Frame::Flange => robot.flange_chain(),
        Frame::Tool => robot.tool_chain(),
    };
    let arm = InverseKinematics::new(chain, &IkSettings::default());
    let wanted = if arguments.all { Wanted::AllBranches } else { Wanted::One };
    let answers = session.pool()?.install(|| answer(&document, &arm, &robot.home, wanted)).or_bad_input()?;
    if let Some(default) = &session.out {
        let path = session.output_directory(default)?.join("ik.json");
        let text = serde_json::to_string_pretty(&answers)?;
        write_whole(&path, |file| writeln!(file, "{text}")).with_context(|| path.display().to_string())?;
    }
    match session.layout {
        Layout::Line => session.print(&answers),
        Layout::Indented => Ok(print(&table(&answers)).context("stdout")?),
    }
}

/// A line for each target; with branches, a further line for each of them.
fn table(answers: &[Answer]) -> String {
    let angles = |q: &[f64]| q.iter().map(|angle| format!("{angle:>8.4}")).collect::<Vec<_>>().join(" ");
    let mut text = format!("{:>6}  {:<11}  {:>9}  {:>9}  joint positions (rad)", "target", "result", "mm", "mrad");
    for (index, answer) in answers.iter().enumerate() {
        let result = match answer.reason {
            None => "solved",
            Some(Reason::Unreachable) => "unreachable",
            Some(Reason::NotFound) => "not found",
        };
        let (distance, angle) = (answer.position_error * 1e3, answer.rotation_error * 1e3);
        text += &format!("\n{index:>6}  {result:<11}  {distance:>9.3e}  {angle:>9.3e}  {}", angles(&answer.joint_positions));
        for branch in answer.branches.iter().flatten() {
            text += &format!("\n{:>6}  {:<11}  {:>9}  {:>9}  {}", "", "branch", "", "", angles(branch));
        }
    }
    text
}
