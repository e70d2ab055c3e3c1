//! The `vmao` program.

fn main() -> std::process::ExitCode {
    vmao::commands::main(std::env::args_os())
}
