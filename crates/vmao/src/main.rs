//! The vmao program.
fn main() {}
