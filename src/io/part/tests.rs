//! Parts: what is written is read, sums are exact, damage is noticed.

use super::format::{Fault, Form, header_bytes};
use super::*;
use proptest::prelude::*;

fn encode_as(part: &Part, form: Form) -> Result<Vec<u8>, String> {
    let (header, mut bytes) = (header_bytes(part)?, Vec::new());
    format::encode(part, &header, form, &mut bytes).expect("writes");
    Ok(bytes)
}

fn encode(part: &Part) -> Result<Vec<u8>, String> {
    encode_as(part, Form::Plain)
}

fn decode(bytes: &[u8]) -> Result<Part, Fault> {
    format::decode(bytes, bytes.len() as u64, |_| Ok(()))
}

fn part(seed: u64, start: u64, end: u64, value: i128) -> Part {
    let header = PartHeader {
        version: "0.1.0".to_owned(),
        scene_hash: 1,
        settings_hash: 2,
        sensor: "main".to_owned(),
        width: 4,
        height: 3,
        crop: [1, 0, 3, 2],
        channels: 3,
        blocks: 0,
        exponent: 0,
        pilot: 0,
        image: BTreeMap::from([("integrator".to_owned(), "bdpt".to_owned())]),
        passes: vec![PassRange { seed, start, end }],
        unfinished: None,
        companions: Vec::new(),
        spectral: None,
    };
    Part {
        header,
        sums: (0..24).map(|i| value + i).collect(),
        unfinished: None,
    }
}

/// Part with a pass of which some pixels are done.
fn unfinished() -> Part {
    let mut part = part(1, 0, 2, 5);
    part.header.unfinished = Some(UnfinishedName { seed: 1, pass: 3 });
    part.unfinished = Some(UnfinishedPass {
        pass: 3,
        done: vec![3],
        sums: (0..12).map(|i| i128::MAX - i).collect(),
    });
    part
}

#[test]
fn what_is_written_is_read() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let path = dir.path().join("a.part");
    for p in [part(u64::MAX, 0, 8, i128::MIN), unfinished()] {
        write(&path, &p).expect("writes");
        assert_eq!(read(&path).expect("reads"), p);
    }
}

#[test]
fn passes_that_are_not_whole_are_not_merged() {
    let (whole, unfinished) = (part(1, 2, 4, 5), unfinished());
    let merged = merge([unfinished.clone(), whole.clone()]).expect("disjoint");
    assert_eq!(merge([whole, unfinished]).expect("disjoint"), merged);
    assert_eq!(
        merged,
        merge([part(1, 0, 2, 5), part(1, 2, 4, 5)]).expect("disjoint")
    );
}

#[test]
fn what_is_done_of_a_pass_fits_the_film() {
    for (damage, message) in [
        (
            (|p| p.header.unfinished = None) as fn(&mut Part),
            "the unfinished pass is not the one of the header",
        ),
        (
            |p| p.header.unfinished = Some(UnfinishedName { seed: 1, pass: 1 }),
            "a pass is whole and unfinished",
        ),
        // the only tile has 4 pixels
        (
            |p| p.unfinished.as_mut().expect("there").done = vec![5],
            "the pixels done of the unfinished pass do not fit the film",
        ),
        (
            |p| p.unfinished.as_mut().expect("there").done.push(0),
            "the pixels done of the unfinished pass do not fit the film",
        ),
    ] {
        let mut part = unfinished();
        damage(&mut part);
        assert_eq!(encode(&part).expect_err("refused"), message);
    }
    // as a file may hold it
    let mut part = unfinished();
    part.header.crop = [0, 0, 4, 3];
    part.sums = vec![0; 72];
    let found = part.unfinished.as_mut().expect("there");
    (found.done, found.sums) = (vec![13], vec![0; 36]);
    let header = serde_json::to_vec(&part.header).expect("encodes");
    let mut bytes = Vec::new();
    format::encode(&part, &header, Form::Plain, &mut bytes).expect("writes");
    let Err(Fault::Format(message)) = decode(&bytes) else {
        panic!("not refused")
    };
    assert_eq!(
        message,
        "the pixels done of the unfinished pass do not fit the film"
    );
}

proptest! {
    #[test]
    fn merging_is_order_free(values in proptest::collection::vec(-1_000_000_i128..1_000_000, 4), swap in 0..24_usize) {
        let mut parts: Vec<Part> =
            values.iter().enumerate().map(|(i, v)| part(i as u64 / 3, 4 * i as u64, 4 * i as u64 + 4, *v)).collect();
        let ordered = merge(parts.clone()).expect("disjoint");
        let last = parts.remove(swap % 4);
        parts.insert(swap % 3, last);
        prop_assert_eq!(&merge(parts).expect("disjoint"), &ordered);
        let expected = [PassRange { seed: 0, start: 0, end: 12 }, PassRange { seed: 1, start: 12, end: 16 }];
        prop_assert_eq!(&ordered.header.passes[..], &expected[..]);
        prop_assert_eq!(ordered.sums[5], values.iter().sum::<i128>() + 20);
        prop_assert_eq!(ordered.header.pass_count(), 16);
    }
}

#[test]
fn overlap_and_strangers_are_refused() {
    let text = |a: &Part, b: &Part| {
        merge([a.clone(), b.clone()])
            .expect_err("refused")
            .to_string()
    };
    let a = part(7, 0, 8, 0);
    assert_eq!(
        text(&a, &part(7, 6, 10, 0)),
        "passes 6..8 of seed 7 are in more than one part"
    );
    assert!(
        merge([a.clone(), part(8, 6, 10, 0)]).is_ok(),
        "another seed is other passes"
    );
    let mut b = part(7, 8, 9, 0);
    b.header.scene_hash = 0x10;
    assert_eq!(
        text(&a, &b),
        "parts differ in scene (hash): 0000000000000001 and 0000000000000010"
    );
    assert!(matches!(
        merge([part(1, 0, 1, i128::MAX - 23), part(1, 1, 2, 1)]),
        Err(PartError::Overflow)
    ));
    assert!(matches!(merge([]), Err(PartError::Empty)));
}

#[test]
fn other_versions_are_refused_by_name() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let path = dir.path().join("old.part");
    let mut bytes = encode(&part(1, 0, 2, 5)).expect("valid");
    bytes[8..12].copy_from_slice(&2_u32.to_le_bytes());
    std::fs::write(&path, bytes).expect("writes");
    let message = read(&path).expect_err("refused").to_string();
    let expected = format!(
        "{}: not a valid part file (version 2, this program reads versions 6 and 7: render the passes again)",
        path.display()
    );
    assert_eq!(message, expected);
}

#[test]
fn damage_is_noticed() {
    for part in [part(1, 0, 2, 5), unfinished()] {
        let forms = [Form::Plain, Form::Packed];
        let [plain, packed] = forms.map(|form| encode_as(&part, form).expect("valid"));
        for bytes in [plain, packed] {
            assert!(decode(&bytes).is_ok_and(|back| back == part));
            for length in 0..bytes.len() {
                assert!(decode(&bytes[..length]).is_err(), "cut to {length}");
            }
            for i in 0..bytes.len() {
                let mut damaged = bytes.clone();
                damaged[i] ^= 1;
                assert!(decode(&damaged).is_err(), "byte {i}");
            }
        }
    }
    let mut bomb = part(1, 0, 2, 5);
    (bomb.header.width, bomb.header.height, bomb.header.crop) =
        (u32::MAX, u32::MAX, [0, 0, u32::MAX, u32::MAX]);
    assert!(encode(&bomb).is_err());
}
