//! Build script of every package that makes programs: lets them find the simulator library at run time.

fn main() {
    println!("cargo::rerun-if-env-changed=MUJOCO_LIB_DIR");
    if let Ok(directory) = std::env::var("MUJOCO_LIB_DIR") {
        println!("cargo::rustc-link-arg=-Wl,-rpath,{directory}");
    }
    println!("cargo::rustc-link-arg=-Wl,-rpath,$ORIGIN/../lib");
}
