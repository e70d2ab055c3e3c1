//! The command line: one module for each command.
//!
//! To add a command: a module here with its `clap::Args` (flatten [`CommonOptions`] into it) and
//! `pub(super) fn run(arguments, &Session) -> Result<(), Failure>`, and its line in [`Command`] and in [`execute`].

mod ocao;
mod session;

pub use session::{CommonOptions, Session};

use crate::{
    failure::{Failure, silence_contained_panics},
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
    /// Goal poses of all parts and grippers from a root pose and joint positions (object-centric control)
    Ocao(ocao::OcaoArguments),
}

/// Runs the program on these arguments, its own name first: 0 done, 1 the work failed, 2 bad input or usage.
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
    let arguments: Vec<String> = arguments.iter().map(|argument| argument.to_string_lossy().into_owned()).collect();
    finish(execute(line.command, &arguments))
}

fn execute(command: Command, command_line: &[String]) -> Result<(), Failure> {
    match command {
        Command::Ocao(arguments) => ocao::run(&arguments, &Session::start(&arguments.common, command_line)?),
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
