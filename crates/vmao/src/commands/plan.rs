//! `vmao plan FILE`: a collision-free path of several arms at once. Without `--json` a short summary.

use super::{CommonOptions, Session};
use crate::{
    failure::{Failure, OrBadInput},
    json::Document,
    output::{Layout, print, write_whole},
    plan::{Answer, answer},
};
use anyhow::Context;
use std::{io::Write, path::PathBuf};

#[derive(Debug, clap::Args)]
pub(super) struct PlanArguments {
    /// The request, a JSON document; - for standard input
    #[arg(value_name = "FILE")]
    request: PathBuf,
    #[command(flatten)]
    pub(super) common: CommonOptions,
}

pub(super) fn run(arguments: &PlanArguments, session: &Session) -> Result<(), Failure> {
    let answer = answer(&Document::read(&arguments.request).or_bad_input()?, arguments.common.seed).or_bad_input()?;
    if let Some(default) = &session.out {
        let path = session.output_directory(default)?.join("plan.json");
        let text = serde_json::to_string_pretty(&answer)?;
        write_whole(&path, |file| writeln!(file, "{text}")).with_context(|| path.display().to_string())?;
    }
    match session.layout {
        Layout::Line => session.print(&answer),
        Layout::Indented => Ok(print(&summary(&answer)).context("stdout")?),
    }
}

fn summary(answer: &Answer) -> String {
    if let Some(reason) = &answer.reason {
        return format!("no path: {reason}");
    }
    let turn = |edge: &[Vec<f64>]| edge[0].iter().zip(&edge[1]).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    let length: f64 = answer.path.windows(2).map(turn).sum();
    let duration = answer.duration.map_or_else(String::new, |duration| format!(", {duration:.2} s at full speed"));
    let (points, margin) = (answer.path.len(), 1e3 * answer.margin);
    format!("a path of {points} points, {length:.2} rad long{duration}, {margin:.1} mm clear; --json prints it")
}
