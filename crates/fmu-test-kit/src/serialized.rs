//! The bytes of a saved state of fmu-export, written from a description of the layout and not with its code, so that
//! tests find what the code gets wrong: 7 bytes of magic and one for the version, the hash of the guid, the interface
//! type (and 2 more for FMI 3.0), then the mode, whether the simulation has ended, time, start time, stop time, tolerance, the values and the
//! memory of the table; at the end FNV-1a of all that. Whole numbers have 64 bits, little-endian; what may be missing
//! has a truth value of one byte before it.

use fmu_export::Mode;
use std::ops::Range;

/// The version of the layout.
pub const VERSION: usize = 7;
/// The hash of the guid.
pub const GUID_HASH: Range<usize> = 8..16;
/// The interface type.
pub const INTERFACE: usize = 16;
/// The mode.
pub const MODE: Range<usize> = 17..25;
/// Whether the model wants the simulation to end.
pub const ENDED: usize = 25;
/// The time.
pub const TIME: Range<usize> = 26..34;
/// Where the values of the variables begin, in the order of the table.
pub const VALUES: usize = 60;
/// The length of the checksum at the end.
pub const CHECKSUM: usize = 8;

/// The hash of the guid, and the checksum.
pub fn fnv1a(bytes: &[u8]) -> [u8; 8] {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for byte in bytes {
        hash = (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
    }
    hash.to_le_bytes()
}

/// Makes the checksum fit the bytes before it.
pub fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let end = bytes.len() - CHECKSUM;
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
    with(bytes, MODE, &i64::from(mode as u32).to_le_bytes())
}

/// The time of the state.
///
/// # Panics
/// When the bytes are too few.
pub fn time(bytes: &[u8]) -> f64 {
    f64::from_le_bytes(bytes[TIME].try_into().expect("8 bytes"))
}
