//! Any bytes through the readers.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| abbe::io::lens::fuzz_lens(bytes));
