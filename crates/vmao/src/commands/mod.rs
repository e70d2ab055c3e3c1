//! The command line: one module for each command.
//!
//! To add a command: a module here with its `clap::Args` (flatten [`CommonOptions`] into it) and
//! `pub(super) fn run(arguments, &Session) -> Result<(), Failure>`, and its line in `Command` and in `execute`.

mod dataset;
mod demo;
mod evaluate;
mod explore;
mod export;
mod figures;
mod ik;
mod object;
mod object_import;
mod ocao;
mod plan;
mod reference;
mod report;
mod reproduce;
mod robot;
mod sample;
mod scene;
mod score;
mod session;
mod train;
mod verify;
mod whole_run;

pub use session::{CommonOptions, Session};

use crate::{
    failure::{Failure, silence_contained_panics},
    interruption::heed,
    output::{log, print},
};
use clap::{Parser, Subcommand};
use std::{ffi::OsString, process::ExitCode};

/// Several robot arms learn where to hold the parts of an articulated object, and move it.
#[derive(Debug, Parser)]
#[command(name = "vmao", version, long_version = LONG_VERSION, propagate_version = true)]
struct CommandLine {
    #[command(subcommand)]
    command: Command,
}

const LONG_VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), " (commit ", env!("VMAO_COMMIT"), ")");

#[derive(Debug, Subcommand)]
enum Command {
    /// The whole loop at laptop size: explore, train, evaluate, report
    Demo(demo::DemoArguments),
    /// The supplement's Table 1 from nothing: three Sawyers, three sticks, three orders; goes on where it was stopped
    Reproduce(reproduce::ReproduceArguments),
    /// The catalogue of objects
    Object(object::ObjectArguments),
    /// Algorithm 1: grow a label set from demonstrations, in physics
    Explore(explore::ExploreArguments),
    /// Data sets: merge those of shards, say what is in one, show a trial
    Dataset(dataset::DatasetArguments),
    /// Train contact networks on an explored data set
    Train(train::TrainArguments),
    /// Contact maps of a trained model on scenes that were never explored, as PLY and a page
    Sample(sample::SampleArguments),
    /// Explored successes of scenes that no training saw, to score models against
    Reference(reference::ReferenceArguments),
    /// Likelihood, coverage, precision and calibration of trained models on held-out scenes
    Score(score::ScoreArguments),
    /// Success rates of trained models
    Evaluate(evaluate::EvaluateArguments),
    /// report.html of a run
    Report(report::ReportArguments),
    /// Key frames and contact maps of a run as pictures, and what lifting changes (the supplement's Figures 3 and 4)
    Figures(figures::FiguresArguments),
    /// A trial of a run as an animated GIF
    Export(export::ExportArguments),
    /// Run recorded trials again and compare them bit for bit
    Verify(verify::VerifyArguments),
    /// Meshes of the robots, for pictures
    Robot(robot::RobotArguments),
    /// The simulated scene as MJCF
    Scene(scene::SceneArguments),
    /// Goal poses of all parts and grippers from a root pose and joint positions (object-centric control)
    Ocao(ocao::OcaoArguments),
    /// Joint positions that put a robot's flange or tool at given poses
    Ik(ik::IkArguments),
    /// A collision-free path of several arms at once
    Plan(plan::PlanArguments),
}

/// Runs the program on these arguments, its own name first: 0 done, 1 the work failed, 2 bad input or usage, 130 Ctrl-C.
pub fn main(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    silence_contained_panics();
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    let line = match CommandLine::try_parse_from(&arguments) {
        Ok(line) => line,
        Err(message) if message.use_stderr() => {
            log(message.render().to_string().trim_end());
            return ExitCode::from(2);
        }
        // `--help` and `--version` are answers.
        Err(message) => return finish(print(message.render().to_string().trim_end()).map_err(Failure::from)),
    };
    if let Err(error) = heed() {
        return finish(Err(Failure::Work(error.into())));
    }
    let arguments: Vec<String> = arguments.iter().map(|argument| argument.to_string_lossy().into_owned()).collect();
    let result = execute(line.command, &arguments);
    if let Some(seconds) = vmao_sim::profile::seconds() {
        log(&profile_table(&seconds));
    }
    finish(result)
}

/// Seconds and shares of the stages of all trials.
fn profile_table(seconds: &[f64]) -> String {
    let total: f64 = seconds.iter().sum();
    let line = |(&(_, name), &spent): (&(_, &str), &f64)| {
        format!("{name:<14} {spent:>9.2} s {:>6.1} %", if total > 0.0 { 100.0 * spent / total } else { 0.0 })
    };
    let lines: Vec<String> = vmao_sim::profile::Stage::ALL.iter().zip(seconds).map(line).collect();
    format!("{}\n{:<14} {total:>9.2} s", lines.join("\n"), "all trials")
}

fn execute(command: Command, command_line: &[String]) -> Result<(), Failure> {
    let session = |common: &CommonOptions| Session::start(common, command_line);
    match command {
        Command::Demo(arguments) => demo::run(&arguments, session(&arguments.common)?),
        Command::Reproduce(arguments) => {
            let session = Session::start_over(Some(reproduce::CONFIGURATION), &arguments.common, command_line)?;
            reproduce::run(&arguments, session)
        }
        Command::Object(arguments) => object::run(&arguments, &session(arguments.action.common())?),
        Command::Explore(arguments) => explore::run(&arguments, session(&arguments.common)?),
        Command::Dataset(arguments) => dataset::run(&arguments, &session(arguments.action.common())?),
        Command::Train(arguments) => train::run(&arguments, &session(&arguments.common)?),
        Command::Sample(arguments) => sample::run(&arguments, &session(&arguments.common)?),
        Command::Reference(arguments) => reference::run(&arguments, session(&arguments.common)?),
        Command::Score(arguments) => score::run(&arguments, session(&arguments.common)?),
        Command::Evaluate(arguments) => evaluate::run(&arguments, session(&arguments.common)?),
        Command::Report(arguments) => report::run(&arguments, &session(&arguments.common)?),
        Command::Figures(arguments) => figures::run(&arguments, &session(&arguments.common)?),
        Command::Export(arguments) => export::run(&arguments, &session(&arguments.common)?),
        Command::Verify(arguments) => verify::run(&arguments, &session(&arguments.common)?),
        Command::Robot(arguments) => robot::run(&arguments, &session(arguments.action.common())?),
        Command::Scene(arguments) => scene::run(&arguments, &session(&arguments.common)?),
        Command::Ik(arguments) => ik::run(&arguments, &session(&arguments.common)?),
        Command::Ocao(arguments) => ocao::run(&arguments, &session(&arguments.common)?),
        Command::Plan(arguments) => plan::run(&arguments, &session(&arguments.common)?),
    }
}

fn finish(result: Result<(), Failure>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            log(&format!("error: {failure}"));
            failure.exit_code()
        }
    }
}
