//! Arrays of a call, and the values that the FMU writes to them.

use super::logger::text_at;
use super::memory::{FILL, Guarded};
use crate::call_sequence::{Kind, Values};
use fmi_abi::c_types::c_char;

/// Array that is passed to a call, and freed after it.
pub struct PassedArray {
    pub array: Guarded,
    pub content: Content,
}

/// Content of an array: input for the FMU, a number of results, or the handle, size or bytes of the saved state at an index.
pub enum Content {
    Input,
    Output(Kind, usize),
    State(usize),
    Size(usize),
    Saved(usize),
}

/// Returns the pointer or size that an array contains.
pub fn word_of(array: &Guarded) -> u64 {
    array.bytes().try_into().map(usize::from_ne_bytes).unwrap_or_default() as u64
}

/// Returns the values that a call wrote to an array. Strings are read only if the call succeeded.
pub fn read(array: &Guarded, kind: Kind, count: usize, succeeded: bool) -> Values {
    let words = array.bytes().chunks_exact(kind.size()).take(count).map(|bytes| {
        let mut word = [0; 8];
        word[..bytes.len()].copy_from_slice(bytes);
        u64::from_le_bytes(word)
    });
    if kind == Kind::Pointer {
        let untouched = u64::from_ne_bytes([FILL; 8]);
        let texts = words.map(|word| {
            let written = succeeded && word != untouched;
            // SAFETY: if the call succeeded, the pointers that it wrote point to strings.
            if written { unsafe { text_at(word as usize as *const c_char) } } else { None }
        });
        return Values::Strings(texts.collect());
    }
    Values::Numbers(kind, words.collect())
}

/// Returns the binary values that fmi3GetBinary returned as pointers and sizes.
pub fn blobs(pointers: &Guarded, sizes: &Values) -> Values {
    let (Values::Numbers(_, pointers), Values::Numbers(_, sizes)) =
        (read(pointers, Kind::Size, usize::MAX, true), sizes)
    else {
        return Values::Strings(Vec::new());
    };
    let blob = |(pointer, size): (u64, &u64)| {
        // SAFETY: the FMU has returned the address and the size of the bytes.
        (pointer != 0 && *size < 1 << 30).then(|| unsafe {
            std::slice::from_raw_parts(pointer as usize as *const u8, *size as usize).to_vec()
        })
    };
    Values::Strings(pointers.into_iter().zip(sizes).map(blob).collect())
}
