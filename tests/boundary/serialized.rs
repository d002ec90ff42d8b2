//! The bytes of a saved state, written from the description of the layout: 7 bytes of magic and one for
//! the version, the hash of the guid, the interface type, the mode as 32-bit integer, then the rest;
//! at the end FNV-1a of all that, little-endian throughout.

use fmi2_export::call_table::Mode;
use std::ops::Range;

pub const VERSION: usize = 7;
pub const GUID_HASH: Range<usize> = 8..16;
pub const INTERFACE: usize = 16;
pub const MODE: Range<usize> = 17..21;
pub const TIME: Range<usize> = 21..29;

pub fn fnv1a(bytes: &[u8]) -> [u8; 8] {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for byte in bytes {
        hash = (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
    }
    hash.to_le_bytes()
}

/// Makes the checksum fit the bytes before it.
pub fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let end = bytes.len() - 8;
    let checksum = fnv1a(&bytes[..end]);
    bytes[end..].copy_from_slice(&checksum);
    bytes
}

/// The state with other bytes somewhere, sealed.
pub fn with(mut bytes: Vec<u8>, at: Range<usize>, patch: &[u8]) -> Vec<u8> {
    bytes[at].copy_from_slice(patch);
    sealed(bytes)
}

/// The state in another mode.
pub fn with_mode(bytes: Vec<u8>, mode: Mode) -> Vec<u8> {
    with(bytes, MODE, &(mode as i32).to_le_bytes())
}
