//! The stamp of a compiled library, which is written when the FMU is packed: the guid, and start values of a variant.
//!
//! The guid is a hash of everything in the FMU, so also of the library, which therefore cannot be compiled with it. Instead, fmu-export
//! compiles a stamp with a guid of zeros into each library; fmu-package finds the stamp by its mark and writes the guid into it.

use std::ops::Range;

/// The guid in a stamp before fmu-package writes another one, and in descriptions that are kept with the sources.
pub const NO_GUID: &str = "{00000000-0000-0000-0000-000000000000}";

/// Beginning of each stamp. The last digit is the version of the layout.
const MARK: &[u8; 24] = b"stamp of fmu-export, v1:";
/// Hash of the model's variables, 8 bytes.
const INTERFACE: Range<usize> = Range { start: MARK.len(), end: MARK.len() + 8 };
const GUID: Range<usize> = Range { start: INTERFACE.end, end: INTERFACE.end + NO_GUID.len() };
/// Number of start values, 2 bytes in little-endian order.
const COUNT: Range<usize> = Range { start: GUID.end, end: GUID.end + 2 };
/// Bytes of a start value: the index of the variable and the value, both in little-endian order.
const START: usize = 4 + 8;

/// Content of the stamp of a library.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct Stamp([u8; Self::SIZE]);

impl Stamp {
    /// Maximum number of start values.
    pub const CAPACITY: usize = 64;
    /// Number of bytes.
    pub const SIZE: usize = COUNT.end + Self::CAPACITY * START;

    /// Creates the stamp that is compiled into a library. It has a guid of zeros and no start values.
    pub const fn new(interface: u64) -> Self {
        let mut bytes = [0; Self::SIZE];
        bytes.split_at_mut(INTERFACE.start).0.copy_from_slice(MARK);
        bytes.split_at_mut(INTERFACE.start).1.split_at_mut(8).0.copy_from_slice(&interface.to_le_bytes());
        bytes.split_at_mut(GUID.start).1.split_at_mut(NO_GUID.len()).0.copy_from_slice(NO_GUID.as_bytes());
        Self(bytes)
    }

    /// Returns the positions of all stamps in a library. A universal library for macOS has one for each processor.
    pub fn positions(library: &[u8]) -> Vec<usize> {
        let is_stamp = |position: &usize| {
            let stamp = &library[*position..];
            stamp.len() >= Self::SIZE
                && stamp.starts_with(MARK)
                && stamp[GUID.start] == b'{'
                && stamp[GUID.end - 1] == b'}'
        };
        let first = MARK[0];
        let candidates = library.iter().enumerate().filter(|(_, byte)| **byte == first);
        candidates.map(|(position, _)| position).filter(is_stamp).collect()
    }

    /// Returns the stamp at a position of a library from [`positions`](Self::positions).
    ///
    /// # Panics
    /// Panics if the library ends before the stamp.
    pub fn read(library: &[u8], position: usize) -> Self {
        let mut stamp = Self::new(0);
        stamp.0.copy_from_slice(&library[position..position + Self::SIZE]);
        stamp
    }

    /// Writes this stamp at a position of a library from [`positions`](Self::positions).
    ///
    /// # Panics
    /// Panics if the library ends before the stamp.
    pub fn write(&self, library: &mut [u8], position: usize) {
        library[position..position + Self::SIZE].copy_from_slice(&self.0);
    }

    /// Returns this stamp with another guid.
    ///
    /// # Panics
    /// Panics if the guid does not have the length of [`NO_GUID`].
    #[must_use]
    pub fn with_guid(mut self, guid: &str) -> Self {
        self.0[GUID].copy_from_slice(guid.as_bytes());
        self
    }

    /// Returns this stamp with other start values: the index of each variable in the table, and its value. A Boolean is 0 or 1.
    ///
    /// # Panics
    /// Panics if there are more than [`CAPACITY`](Self::CAPACITY).
    #[must_use]
    pub fn with_starts(mut self, starts: &[(u32, f64)]) -> Self {
        assert!(starts.len() <= Self::CAPACITY, "a library can have at most {} start values", Self::CAPACITY);
        self.0[COUNT].copy_from_slice(&(starts.len() as u16).to_le_bytes());
        self.0[COUNT.end..].fill(0);
        for ((index, value), bytes) in starts.iter().zip(self.0[COUNT.end..].chunks_exact_mut(START)) {
            bytes[..4].copy_from_slice(&index.to_le_bytes());
            bytes[4..].copy_from_slice(&value.to_le_bytes());
        }
        self
    }

    /// Returns the hash of the model's variables. Libraries of the same model have the same hash, on every platform.
    pub fn interface(&self) -> &[u8] {
        &self.0[INTERFACE]
    }

    /// Returns the guid.
    pub fn guid(&self) -> &str {
        std::str::from_utf8(self.guid_bytes()).unwrap_or(NO_GUID)
    }

    /// Returns the guid as bytes.
    #[inline]
    pub fn guid_bytes(&self) -> &[u8] {
        &self.0[GUID]
    }

    /// Returns the start values: the index of each variable in the table, and its value.
    pub fn starts(&self) -> impl Iterator<Item = (u32, f64)> {
        let count = usize::from(u16::from_le_bytes([self.0[COUNT.start], self.0[COUNT.start + 1]]));
        self.0[COUNT.end..].chunks_exact(START).take(count).map(|bytes| {
            let (mut index, mut value) = ([0; 4], [0; 8]);
            index.copy_from_slice(&bytes[..4]);
            value.copy_from_slice(&bytes[4..]);
            (u32::from_le_bytes(index), f64::from_le_bytes(value))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GUID: &str = "{01234567-89ab-8cde-8f01-23456789abcd}";

    #[test]
    fn a_stamp_is_found_and_replaced() {
        let mut library = vec![7; 10];
        // The mark alone is not a stamp.
        library.extend(MARK);
        library.extend(Stamp::new(5).0);
        library.extend([9; 3]);
        assert_eq!(Stamp::positions(&library), [34]);
        let stamp = Stamp::read(&library, 34);
        assert_eq!((stamp.interface()[0], stamp.guid(), stamp.starts().count()), (5, NO_GUID, 0));
        let starts = [(3, 0.1), (u32::MAX, -2.5e-300)];
        stamp.with_guid(GUID).with_starts(&starts).write(&mut library, 34);
        assert_eq!(Stamp::positions(&library), [34]);
        let stamp = Stamp::read(&library, 34);
        assert_eq!(stamp.guid(), GUID);
        assert_eq!(stamp.starts().collect::<Vec<_>>(), starts);
        assert_eq!(stamp.with_guid(NO_GUID).with_starts(&[]).0, Stamp::new(5).0);
        library.truncate(34 + Stamp::SIZE - 1);
        assert!(Stamp::positions(&library).is_empty());
    }
}
