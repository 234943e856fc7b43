//! Attributes of an OpenEXR header in the order of their names.
//!
//! The encoder keeps custom attributes in a hash map, so their order changes from run to run;
//! sorted, equal images are equal files. Layout (openexr.com, "OpenEXR File Layout"): magic and
//! version in 8 bytes, then per attribute a name and a type, each ended by a zero byte, a 32-bit
//! length and the value; a zero byte ends the header.

/// Before the first attribute.
const START: usize = 8;

/// Sorts the attributes of the one header of an encoded image. Bytes that are no such header stay
/// as they are.
pub fn sort_attributes(file: &mut [u8]) {
    let Some(mut attributes) = attributes(file) else {
        return;
    };
    let end = START + attributes.iter().map(|a| a.1.len()).sum::<usize>();
    attributes.sort();
    let sorted: Vec<u8> = attributes.into_iter().flat_map(|a| a.1).collect();
    file[START..end].copy_from_slice(&sorted);
}

/// Name and all bytes of each attribute.
fn attributes(file: &[u8]) -> Option<Vec<(Vec<u8>, Vec<u8>)>> {
    let text_length = |bytes: &[u8]| bytes.iter().position(|&b| b == 0);
    let mut found = Vec::new();
    let mut rest = file.get(START..)?;
    while *rest.first()? != 0 {
        let name = text_length(rest)?;
        let kind = text_length(rest.get(name + 1..)?)?;
        let head = name + kind + 2;
        let length = rest
            .get(head..head + 4)?
            .try_into()
            .ok()
            .map(i32::from_le_bytes)?;
        let total = head
            .checked_add(4)?
            .checked_add(usize::try_from(length).ok()?)?;
        found.push((rest[..name].to_vec(), rest.get(..total)?.to_vec()));
        rest = &rest[total..];
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(attributes: &[(&str, &str)]) -> Vec<u8> {
        let mut bytes = b"magicver".to_vec();
        for (name, value) in attributes {
            bytes.extend(
                [
                    name.as_bytes(),
                    b"\0string\0",
                    &(value.len() as i32).to_le_bytes(),
                    value.as_bytes(),
                ]
                .concat(),
            );
        }
        bytes.extend(b"\0pixels b a");
        bytes
    }

    #[test]
    fn any_order_gives_the_same_file() {
        let mut forward = file(&[("a", "1"), ("b", "22"), ("c", "")]);
        let mut backward = file(&[("c", ""), ("b", "22"), ("a", "1")]);
        assert_ne!(forward, backward);
        sort_attributes(&mut forward);
        sort_attributes(&mut backward);
        assert_eq!(forward, backward);
        assert_eq!(forward, file(&[("a", "1"), ("b", "22"), ("c", "")]));
    }

    #[test]
    fn broken_headers_stay() {
        let whole = file(&[("b", "22"), ("a", "1")]);
        let end = whole.len() - b"\0pixels b a".len();
        for length in 0..=end {
            let mut cut = whole[..length].to_vec();
            sort_attributes(&mut cut);
            assert_eq!(cut, whole[..length]);
        }
    }
}
