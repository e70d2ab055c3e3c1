#![no_main]

libfuzzer_sys::fuzz_target!(
    // The geometry library may panic on degenerate input, and is contained; only what gets out is a crash.
    init: drop(std::panic::take_hook()),
    |bytes: &[u8]| vmao_import::readers::mesh(bytes)
);
