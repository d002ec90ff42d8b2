//! Renews the signature of a changed library for macOS.
//!
//! Linkers sign libraries for macOS ad hoc, without a certificate: the signature contains a hash of each page of the file, and macOS
//! rejects a page with another hash. So after a change, it suffices to calculate the hashes again. The format is described in
//! `cs_blobs.h` of Apple's XNU; all its numbers are big-endian.

use anyhow::{Context, Result, ensure};
use object::endian::BigEndian;
use object::macho::{FAT_MAGIC, LC_CODE_SIGNATURE, LinkeditDataCommand, MachHeader64};
use object::read::macho::{FatArch, MachHeader, MachOFatFile32};
use object::{Endianness, FileKind};
use sha2::{Digest, Sha256};
use std::ops::Range;

/// Magic number of the list of blobs in a signature.
const SIGNATURE: u32 = 0xfade_0cc0;
/// Magic number of the blob with the hashes of pages.
const CODE_DIRECTORY: u32 = 0xfade_0c02;
/// The kind of hash that current linkers write: SHA-256, 32 bytes.
const SHA256: [u8; 2] = [32, 2];

/// Renews the hashes in the signature of a library. Does nothing for a library of another system, or without a signature.
///
/// # Errors
/// When the signature has an unknown form.
pub fn sign(library: &mut [u8]) -> Result<()> {
    for part in parts(library)? {
        sign_part(&mut library[part]).context("the signature for macOS cannot be renewed")?;
    }
    Ok(())
}

/// Returns the ranges of the 64-bit Mach-O files in a library: one, or several in a universal library.
fn parts(library: &[u8]) -> Result<Vec<Range<usize>>> {
    if library.starts_with(&FAT_MAGIC.to_be_bytes()) {
        let file = MachOFatFile32::parse(library)?;
        let range = |(offset, size)| {
            let range = usize::try_from(offset)?..usize::try_from(offset + size)?;
            ensure!(range.end <= library.len(), "the universal library is truncated");
            Ok(range)
        };
        return file.arches().iter().map(|part| range(part.file_range())).collect();
    }
    let is_one = matches!(FileKind::parse(library), Ok(FileKind::MachO64));
    Ok(is_one.then_some(0..library.len()).into_iter().collect())
}

fn sign_part(part: &mut [u8]) -> Result<()> {
    let Some(signature) = signature(part)? else { return Ok(()) };
    let (content, rest) = part.split_at_mut_checked(signature.start).context("it is outside of the file")?;
    let signature = rest.get_mut(..signature.len()).context("it is outside of the file")?;
    ensure!(number(signature, 0)? == SIGNATURE, "it is not a list of blobs");
    for index in 0..number(signature, 8)? as usize {
        let offset = number(signature, 12 + 8 * index + 4)? as usize;
        let blob = signature.get_mut(offset..).context("a blob is outside of it")?;
        if number(blob, 0)? == CODE_DIRECTORY {
            hash_pages(content, blob)?;
        }
    }
    Ok(())
}

/// Returns the range of the signature in a Mach-O file, if there is one.
fn signature(part: &[u8]) -> Result<Option<Range<usize>>> {
    let header = MachHeader64::<Endianness>::parse(part, 0)?;
    let endian = header.endian()?;
    let mut commands = header.load_commands(endian, part, 0)?;
    while let Some(command) = commands.next()? {
        if command.cmd() == LC_CODE_SIGNATURE {
            let data: &LinkeditDataCommand<Endianness> = command.data()?;
            let start = data.dataoff.get(endian) as usize;
            return Ok(Some(start..start + data.datasize.get(endian) as usize));
        }
    }
    Ok(None)
}

/// Writes the hashes of all pages of `content` into a code directory.
fn hash_pages(content: &[u8], directory: &mut [u8]) -> Result<()> {
    let [hashes, slots, limit] =
        [16, 28, 32].map(|position| number(directory, position).map(|number| number as usize));
    let (hashes, slots, limit) = (hashes?, slots?, limit?);
    let kind = directory.get(36..40).context("it is truncated")?;
    ensure!(kind[..2] == SHA256, "it has hashes of an unknown kind");
    let page = 1_usize.checked_shl(kind[3].into()).context("its pages are too large")?;
    let pages = content.get(..limit).context("it covers more than the file")?.chunks(page);
    ensure!(pages.len() == slots, "it has {slots} hashes for {} pages", pages.len());
    let hashes = directory.get_mut(hashes..hashes + slots * 32).context("its hashes are outside of it")?;
    for (page, hash) in pages.zip(hashes.chunks_exact_mut(32)) {
        hash.copy_from_slice(&Sha256::digest(page));
    }
    Ok(())
}

fn number(bytes: &[u8], position: usize) -> Result<u32> {
    let (number, _) =
        object::pod::from_bytes::<object::U32<BigEndian>>(bytes.get(position..).unwrap_or_default())
            .ok()
            .context("it is truncated")?;
    Ok(number.get(BigEndian))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a Mach-O file with 5000 bytes of content, signed as a linker does: two pages of 4096 bytes, without their hashes.
    fn file() -> Vec<u8> {
        let mut file = Vec::new();
        // Magic number, ARM, library, one command of 16 bytes; the command names the position and the size of the signature.
        let header = [0xfeed_facf, 0x0100_000c, 0, 6, 1, 16, 0, 0, 0x1d, 16, 5000, 148];
        header.iter().for_each(|word: &u32| file.extend(word.to_le_bytes()));
        file.resize(5000, 7);
        // The list of blobs: one code directory at byte 20.
        let directory = [CODE_DIRECTORY, 128, 0x20400, 0, 64, 44, 0, 2, 5000, 0x2002_000c, 0];
        let blobs = [SIGNATURE, 148, 1, 0, 20];
        blobs.iter().chain(&directory).for_each(|word| file.extend(word.to_be_bytes()));
        file.extend([0; 20 + 64]);
        file
    }

    #[test]
    fn hashes_of_all_pages_are_renewed() {
        let mut signed = file();
        sign(&mut signed).unwrap();
        assert_eq!(signed[..5084], file()[..5084]);
        // From Python: hashlib.sha256 of the pages file[:4096] and file[4096:5000].
        let hex: String = signed[5084..].iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(hex, HASHES.concat());
        let mut changed = signed.clone();
        changed[4999] ^= 1;
        sign(&mut changed).unwrap();
        assert_eq!(changed[..4999], signed[..4999]);
        assert_ne!(changed[5116..], signed[5116..]);
    }

    const HASHES: [&str; 2] = [
        "2beaa2dd4da3233578cfe3d0edf9268beba7363fb9c054107b48dafbd670ba76",
        "f4396a044e43f29930808c0a1bc8e2dd4834aa538559cdf47223e142dce7a5d7",
    ];

    #[test]
    fn unknown_signatures_are_errors_and_other_files_stay() {
        for (position, message) in [
            (5000, "not a list of blobs"),
            (5056, "unknown kind"),
            (5051, "1 hashes for 2 pages"),
            (5036, "hashes are outside"),
        ] {
            let mut file = file();
            file[position] ^= 3;
            let error = format!("{:#}", sign(&mut file).unwrap_err());
            assert!(error.contains(message), "{position}: {error}");
        }
        for end in (4999..5147).chain([40]) {
            assert!(sign(&mut file()[..end]).is_err(), "{end}");
        }
        let mut other = b"\x7fELF and more".to_vec();
        sign(&mut other).unwrap();
        assert_eq!(other, b"\x7fELF and more");
    }
}
