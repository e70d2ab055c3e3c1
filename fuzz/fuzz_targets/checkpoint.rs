#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| vmao_net::readers::checkpoint(bytes));
