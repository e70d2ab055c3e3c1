//! Build script of every package that makes programs: lets them find the simulator library at run time.
#![allow(clippy::print_stdout, unreachable_pub, reason = "cargo listens on stdout; another build script includes this one")]

/// Fetches the library if it is missing, and tells the linker where programs will look for it.
pub fn main() {
    println!("cargo::rerun-if-env-changed=MUJOCO_LIB_DIR");
    if let Ok(directory) = std::env::var("MUJOCO_LIB_DIR") {
        let fetch = std::path::Path::new(&directory).join("../../../tools/get-mujoco");
        println!("cargo::rerun-if-changed={directory}/../complete");
        // A build folder may outlive third_party/: then nothing else would fetch the library again.
        match std::process::Command::new(&fetch).status() {
            Ok(status) if status.success() => {}
            outcome => println!("cargo::error={}: {outcome:?}", fetch.display()),
        }
        println!("cargo::rustc-link-arg=-Wl,-rpath,{directory}");
    }
    println!("cargo::rustc-link-arg=-Wl,-rpath,$ORIGIN/../lib");
}
