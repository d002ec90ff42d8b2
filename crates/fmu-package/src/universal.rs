//! Libraries of macOS for several processors in one file, as FMI 2.0 has one folder for them.

use crate::pack::Library;
use crate::platform::Platform;
use anyhow::{Context, Result, ensure};
use object::macho::{FAT_MAGIC, MachHeader64};
use object::read::macho::MachHeader;
use object::{BigEndian, Endianness, U32};
use std::fs;

/// Where a part begins: at multiples of the largest pages there are.
const ALIGNMENT: u32 = 14;

/// Puts both libraries of macOS, if there are such, into the place of the one for Intel, where importers on ARM look, too;
/// what is there may be for both already.
pub fn join_for_macos(libraries: &mut [Library]) -> Result<()> {
    let find = |architecture| {
        let platform = Platform::of(architecture, "macos").ok()?;
        libraries.iter().position(|library| library.platform == platform)
    };
    let (Some(intel), Some(arm)) = (find("x86_64"), find("aarch64")) else { return Ok(()) };
    let mut parts = Vec::new();
    for place in [intel, arm] {
        let path = &libraries[place].path;
        parts.push(fs::read(path).with_context(|| format!("cannot read {}", path.display()))?);
    }
    if parts[0].starts_with(&FAT_MAGIC.to_be_bytes()) {
        return Ok(());
    }
    let path = libraries[intel].path.with_extension("universal.dylib");
    let joined = joined(&parts).context("the libraries for macOS")?;
    fs::write(&path, joined).with_context(|| format!("cannot write {}", path.display()))?;
    libraries[intel].path = path;
    Ok(())
}

/// A header, which says what each part is for and where it is; then the parts.
fn joined(parts: &[Vec<u8>]) -> Result<Vec<u8>> {
    let mut header = vec![FAT_MAGIC, parts.len() as u32];
    let mut file = vec![0; 1 << ALIGNMENT];
    for part in parts {
        let of = MachHeader64::<Endianness>::parse(&part[..], 0)?;
        let endian = of.endian()?;
        file.resize(file.len().next_multiple_of(1 << ALIGNMENT), 0);
        header.extend([of.cputype(endian).0, of.cpusubtype(endian).0]);
        header.extend([u32::try_from(file.len())?, u32::try_from(part.len())?, ALIGNMENT]);
        file.extend(part);
    }
    ensure!(header.len() * size_of::<u32>() <= 1 << ALIGNMENT, "too many parts");
    for (place, word) in header.into_iter().enumerate() {
        let word = U32::new(BigEndian, word);
        file[4 * place..4 * place + 4].copy_from_slice(object::bytes_of(&word));
    }
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_for_both_already_stays() {
        let folder = std::env::temp_dir().join(format!("universal-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder");
        let mut libraries = Vec::new();
        for (architecture, bytes) in [("x86_64", FAT_MAGIC.to_be_bytes()), ("aarch64", [0; 4])] {
            let path = folder.join(architecture);
            fs::write(&path, bytes).expect("a file");
            libraries.push(Library { platform: Platform::of(architecture, "macos").expect("known"), path });
        }
        join_for_macos(&mut libraries).expect("nothing is joined");
        assert_eq!(libraries[0].path, folder.join("x86_64"));
        fs::remove_dir_all(&folder).expect("a folder");
    }
}
