//! 20,000 seeded mutations of valid files through each reader: no panic, no large allocation.

use super::binary::{valid_exr, valid_part};
use abbe::math::hash::random_bits;

const MUTATIONS: u64 = 20_000;

/// Mutation `index` of `valid`: bytes changed, cut out, repeated or replaced by pieces of `dictionary`.
fn mutate(valid: &[u8], index: u64, dictionary: &[&[u8]]) -> Vec<u8> {
    let mut bytes = valid.to_vec();
    let mut counter = 0;
    let mut below = |n: usize| {
        counter += 1;
        (random_bits(index, counter) % n.max(1) as u64) as usize
    };
    for _ in 0..=below(4) {
        let at = below(bytes.len());
        let end = (at + 1 + below(16)).min(bytes.len());
        match below(6) {
            0 if at < bytes.len() => bytes[at] = below(256) as u8,
            1 if at < bytes.len() => bytes[at] ^= 1 << below(8),
            2 => drop(bytes.drain(at..end)),
            3 => {
                let piece = bytes[at..end].to_vec();
                bytes.splice(at..at, piece);
            }
            4 => drop(bytes.splice(at..end, dictionary[below(dictionary.len())].iter().copied())),
            _ if below(4) == 0 => bytes.truncate(at),
            _ => {}
        }
    }
    bytes
}

fn run(valid: &[u8], dictionary: &[&[u8]], read: fn(&[u8])) {
    for index in 0..MUTATIONS {
        let bytes = mutate(valid, index, dictionary);
        let outcome = std::panic::catch_unwind(|| read(&bytes));
        assert!(
            outcome.is_ok(),
            "mutation {index} panics: {:?}",
            String::from_utf8_lossy(&bytes)
        );
    }
}

#[test]
fn scenes() {
    let dictionary: [&[u8]; 12] = [
        b"nan",
        b"-1e308",
        b"inf",
        b"[]",
        b"{}",
        b"\"\"",
        b"9223372036854775807",
        b"[[",
        b"]",
        b" = ",
        b"0",
        b"\"ball\"",
    ];
    run(
        include_bytes!("valid.toml"),
        &dictionary,
        abbe::io::scene_file::fuzz_scene,
    );
}

#[test]
fn images() {
    run(
        &valid_exr(),
        &[
            &[0; 4],
            &[255; 4],
            &[0x7f, 0xff, 0xff, 0xff],
            &[0, 0, 0, 0x80],
            b"\0",
        ],
        abbe::io::exr::fuzz_exr,
    );
}

#[test]
fn parts() {
    run(
        &valid_part(),
        &[
            &[0; 4],
            &[255; 4],
            b"-1",
            b"18446744073709551615",
            b"}",
            b"[]",
        ],
        abbe::io::part::fuzz_part,
    );
}
