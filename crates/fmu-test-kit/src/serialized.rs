//! The bytes of a serialized state of fmu-export. This module was written from a description of the layout and shares only
//! the enumeration `Mode` with fmu-export, so that tests detect errors there.
//!
//! The layout is: 7 bytes of magic, one byte for the version, 8 bytes for the hash of the guid, and one byte for the interface type
//! (plus 2 for FMI 3.0). The mode, the end flag, time, start time, stop time and tolerance follow, then the
//! values and the `memory` fields of the variable table. The last 8 bytes are the FNV-1a checksum of all bytes before.
//! Integers have 64 bits, little-endian. Before an optional value, there is a Boolean of one byte, which is
//! true if the value exists; the bytes of the value are present in both cases.

use fmu_export::Mode;
use std::ops::Range;

/// Index of the version of the layout.
pub const VERSION: usize = 7;
/// Range of the hash of the guid.
pub const GUID_HASH: Range<usize> = 8..16;
/// Index of the interface type.
pub const INTERFACE: usize = 16;
/// Range of the mode.
pub const MODE: Range<usize> = 17..25;
/// Index of the Boolean that is true if the model has requested the end of the simulation.
pub const ENDED: usize = 25;
/// Range of the time.
pub const TIME: Range<usize> = 26..34;
/// Index of the first value of the variables, which are in the order of the table.
pub const VALUES: usize = 60;
/// Length of the checksum at the end.
pub const CHECKSUM: usize = 8;

/// Returns the FNV-1a hash, used for the guid and the checksum.
pub fn fnv1a(bytes: &[u8]) -> [u8; 8] {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for byte in bytes {
        hash = (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
    }
    hash.to_le_bytes()
}

/// Returns the bytes with an updated checksum.
pub fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let end = bytes.len() - CHECKSUM;
    let checksum = fnv1a(&bytes[..end]);
    bytes[end..].copy_from_slice(&checksum);
    bytes
}

/// Replaces the bytes in the range `at` and updates the checksum.
pub fn with(mut bytes: Vec<u8>, at: Range<usize>, patch: &[u8]) -> Vec<u8> {
    bytes[at].copy_from_slice(patch);
    sealed(bytes)
}

/// Replaces the mode and updates the checksum.
pub fn with_mode(bytes: Vec<u8>, mode: Mode) -> Vec<u8> {
    with(bytes, MODE, &i64::from(mode as u32).to_le_bytes())
}

/// Returns the time of the state.
///
/// # Panics
/// Panics if there are too few bytes.
pub fn time(bytes: &[u8]) -> f64 {
    f64::from_le_bytes(bytes[TIME].try_into().expect("8 bytes"))
}
