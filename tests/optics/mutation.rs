//! Damaged lens files and catalogs: an error or a lens, never a panic.

use abbe::io::{glass, lens};

/// SplitMix64.
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        (abbe::math::hash::mix64(self.0) % n.max(1) as u64) as usize
    }
}

fn damage(bytes: &mut Vec<u8>, random: &mut Random) {
    const WORDS: [&str; 12] = [
        "nan",
        "inf",
        "-1",
        "0",
        "1e308",
        "1e-308",
        "INFINITY",
        "\n",
        "SURF 0\n",
        "COORDBRK",
        "\u{fffd}",
        "999999999999",
    ];
    for _ in 0..=random.below(4) {
        let at = random.below(bytes.len());
        match random.below(5) {
            0 => bytes.truncate(at),
            1 => _ = bytes.get_mut(at).map(|b| *b ^= 1 << (at % 8)),
            2 => {
                let word = WORDS[random.below(WORDS.len())].bytes();
                bytes.splice(at..(at + random.below(8)).min(bytes.len()), word);
            }
            3 => {
                let to = (at + random.below(200)).min(bytes.len());
                bytes.drain(at..to);
            }
            _ => {
                let to = (at + random.below(200)).min(bytes.len());
                let copy = bytes[at..to].to_vec();
                let into = random.below(bytes.len());
                bytes.splice(into..into, copy);
            }
        }
    }
}

#[test]
fn damaged_files_make_no_panic() {
    let folder = super::root().join("scenes/lenses");
    let mut sources: Vec<Vec<u8>> = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        sources.push(std::fs::read(entry.unwrap().path()).unwrap());
    }
    assert!(sources.len() >= 9);
    sources.push(
        b"NM G 2 517642 1.5 64 0\nCD 1.03 0.006 0.23 0.02 1.01 103.5\nLD 0.3 2.5\nIT 0.5 0.99 10\n"
            .to_vec(),
    );
    sources.push(
        b"DATA:\n  - type: tabulated nk\n    data: |\n        0.4 1.5 0.1\n        0.6 1.4 0.2\n"
            .to_vec(),
    );
    let mut random = Random(7);
    let scale = std::env::var("ABBE_TEST_SCALE").ok();
    let scale: u32 = scale.and_then(|s| s.parse().ok()).unwrap_or(1);
    for _ in 0..150 * scale {
        for source in &sources {
            let mut bytes = source.clone();
            damage(&mut bytes, &mut random);
            lens::fuzz_lens(&bytes);
            glass::fuzz_catalog(&bytes);
        }
    }
}
