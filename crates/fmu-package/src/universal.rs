//! Joins the macOS libraries for Intel and ARM in one file, because importers on both processors look in the same directory of an FMU
//! for FMI 2.0.

use crate::library::Library;
use crate::platform::Platform;
use anyhow::{Context, Result, ensure};
use object::macho::{FAT_MAGIC, MachHeader64};
use object::read::macho::MachHeader;
use object::{BigEndian, Endianness, U32};

/// Binary logarithm of the alignment of each part. 16 KiB is the largest page size.
const ALIGNMENT: u32 = 14;

/// Joins the two libraries for macOS, if there are two. The result replaces the library for Intel, because importers on ARM also look
/// in its directory. A library for Intel that is already universal is kept.
pub fn join_for_macos(libraries: &mut [Library]) -> Result<()> {
    let find = |architecture| {
        let platform = Platform::of(architecture, "macos").ok()?;
        libraries.iter().position(|library| library.platform == platform)
    };
    let (Some(intel), Some(arm)) = (find("x86_64"), find("aarch64")) else { return Ok(()) };
    let parts = [intel, arm].map(|index| &libraries[index].bytes[..]);
    if !parts[0].starts_with(&FAT_MAGIC.to_be_bytes()) {
        libraries[intel].bytes = joined(&parts).context("the libraries for macOS")?;
    }
    Ok(())
}

/// Returns a universal library: a header with the processor and the position of each part, followed by the parts.
fn joined(parts: &[&[u8]]) -> Result<Vec<u8>> {
    let mut header = vec![FAT_MAGIC, parts.len() as u32];
    let mut file = vec![0; 1 << ALIGNMENT];
    for part in parts {
        let library = MachHeader64::<Endianness>::parse(*part, 0)?;
        let endian = library.endian()?;
        file.resize(file.len().next_multiple_of(1 << ALIGNMENT), 0);
        header.extend([library.cputype(endian).0, library.cpusubtype(endian).0]);
        header.extend([u32::try_from(file.len())?, u32::try_from(part.len())?, ALIGNMENT]);
        file.extend(*part);
    }
    ensure!(header.len() * size_of::<u32>() <= 1 << ALIGNMENT, "too many parts");
    for (index, word) in header.into_iter().enumerate() {
        let word = U32::new(BigEndian, word);
        file[4 * index..4 * index + 4].copy_from_slice(object::bytes_of(&word));
    }
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_universal_library_is_kept() {
        let mut libraries = Vec::new();
        for (architecture, bytes) in [("x86_64", FAT_MAGIC.to_be_bytes()), ("aarch64", [0; 4])] {
            let platform = Platform::of(architecture, "macos").expect("known");
            libraries.push(Library::new(platform, bytes.to_vec()));
        }
        join_for_macos(&mut libraries).expect("nothing is joined");
        assert_eq!(libraries[0].bytes, FAT_MAGIC.to_be_bytes());
    }
}
