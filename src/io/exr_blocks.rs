//! Sizes that DWA blocks of an OpenEXR image claim for what they hold, looked at before a decoder
//! makes room for them.

use exr::block::chunk::{Chunk, CompressedBlock};
use exr::compression::Compression;
use exr::error::{Error, Result};
use exr::meta::header::Header;
use std::io::Cursor;

/// Counters at the head of a block, of 8 bytes each (OpenEXR, `DataSizesSingle`).
const COUNTERS: usize = 11;
/// Those of them that say how much comes out: of the unknown channels, of run lengths twice, and
/// of both kinds of coefficients.
const SIZES: [usize; 5] = [1, 6, 7, 8, 9];
/// Side of a block of coefficients, pixels.
const SIDE: usize = 8;
/// Bytes of the largest sample.
const SAMPLE: usize = 4;

/// Checks that no block claims to hold more than its pixels can have.
///
/// # Errors
/// One does, or blocks cannot be read.
pub fn check(file: &[u8]) -> Result<()> {
    let reader = exr::block::read(Cursor::new(file), false)?;
    let is_dwa = |h: &Header| matches!(h.compression, Compression::DWAA(_) | Compression::DWAB(_));
    let headers = reader.headers().to_vec();
    if !headers.iter().any(is_dwa) {
        return Ok(());
    }
    for chunk in reader.all_chunks(false)? {
        let chunk = chunk?;
        let header = headers.get(chunk.layer_index).filter(|h| is_dwa(h));
        header.map_or(Ok(()), |header| check_block(header, &chunk))?;
    }
    Ok(())
}

fn check_block(header: &Header, chunk: &Chunk) -> Result<()> {
    let bytes = match &chunk.compressed_block {
        CompressedBlock::ScanLine(block) => &block.compressed_pixels_le,
        CompressedBlock::Tile(block) => &block.compressed_pixels_le,
        CompressedBlock::DeepScanLine(_) | CompressedBlock::DeepTile(_) => return Ok(()),
    };
    let place = header.get_block_data_indices(&chunk.compressed_block)?;
    let bounds = header.get_absolute_block_pixel_coordinates(place)?;
    bounds.validate(Some(header.layer_size))?;
    let size = bounds.size;
    // what compression would not have made smaller is stored as it is
    if bytes.len() == size.area() * header.channels.bytes_per_pixel {
        return Ok(());
    }
    let padded = |n: usize| n.next_multiple_of(SIDE);
    let samples = padded(size.x()) * padded(size.y()) * header.channels.list.len();
    // run lengths of what has none take a little more than it
    let most = (2 * samples * SAMPLE) as u64;
    let (counters, _) = bytes.as_chunks::<8>();
    let counters = counters.get(..COUNTERS);
    let too_large = |counters: &[[u8; 8]]| {
        let counter = |&i: &usize| u64::from_le_bytes(counters[i]);
        SIZES.iter().map(counter).any(|size| size > most)
    };
    if counters.is_none_or(too_large) {
        return Err(Error::Invalid(
            "a DWA block claims more than its pixels hold".into(),
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_block_claims_is_compared_with_its_pixels() {
        let valid = include_bytes!("../../tests/models/cases/exr-kinds/dwaa_half.exr");
        check(valid).expect("valid");
        let counter = |bytes: &[u8]| u64::from_le_bytes(std::array::from_fn(|i| bytes[i]));
        let is_head = |bytes: &[u8]| {
            let sizes = bytes.chunks(8).skip(1).all(|size| counter(size) < 1 << 20);
            counter(bytes) == 2 && sizes
        };
        let head = valid.windows(8 * COUNTERS).position(is_head);
        let head = head.expect("the counters of a block");
        for size in SIZES {
            let mut bomb = valid.to_vec();
            bomb[head + 8 * size..][..8].copy_from_slice(&(1_u64 << 40).to_le_bytes());
            let error = check(&bomb).expect_err("a bomb").to_string();
            assert!(
                error.contains("claims more than its pixels hold"),
                "{error}"
            );
            let read =
                crate::io::image_file::decode(&bomb, crate::io::image_file::Encoding::Linear);
            assert!(read.is_err_and(|e| e.contains("claims more")), "{size}");
        }
    }
}
