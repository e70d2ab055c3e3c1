//! Files, configuration, the command line, evaluation and reports of the vmao program.

pub mod report;
