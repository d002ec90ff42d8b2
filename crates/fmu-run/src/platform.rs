//! Finds the platform for which a library was built, from the headers of the file.

use std::env::consts::{ARCH, OS};
use std::path::Path;

/// If a library is for another platform, returns a message that names its platform and this one.
pub(crate) fn mismatch(library: &Path) -> Option<String> {
    let bytes = std::fs::read(library).ok()?;
    let (system, processors) = target_of(&bytes)?;
    let here = match OS {
        "linux" => "Linux",
        "macos" => "macOS",
        "windows" => "Windows",
        other => other,
    };
    let fits = system == here && processors.contains(&ARCH);
    (!fits)
        .then(|| format!("it is for {system} on {}, and this is {here} on {ARCH}", processors.join(" and ")))
}

/// Returns the operating system and the processors of a library, which have the names of `std::env::consts::ARCH`. Returns `None`
/// for unknown formats and processors.
fn target_of(bytes: &[u8]) -> Option<(&'static str, Vec<&'static str>)> {
    let at = |index: usize| bytes.get(index..)?.first_chunk::<4>().copied();
    let number = |index| at(index).map(u32::from_le_bytes);
    let half = |index| number(index).map(|word| word & 0xffff);
    let mach = |processor: u32| match processor {
        7 => Some("x86"),
        0x0100_0007 => Some("x86_64"),
        12 => Some("arm"),
        0x0100_000c => Some("aarch64"),
        _ => None,
    };
    Some(match at(0)? {
        // The bytes 4 and 5 are the class (word width) and the byte order; e_machine at offset 18 is the processor.
        [0x7f, b'E', b'L', b'F'] => {
            let [class, order, ..] = at(4)?;
            let machine = if order == 2 { half(18)?.swap_bytes() >> 16 } else { half(18)? };
            let processor = match (machine, class) {
                (3, _) => "x86",
                (40, _) => "arm",
                (62, _) => "x86_64",
                (183, _) => "aarch64",
                (243, 1) => "riscv32",
                (243, _) => "riscv64",
                (21, _) => "powerpc64",
                (22, _) => "s390x",
                (258, _) => "loongarch64",
                _ => return None,
            };
            ("Linux", vec![processor])
        }
        // The offset of the PE header is at 0x3c. The machine follows the signature of the header.
        [b'M', b'Z', ..] => {
            let header = number(0x3c)? as usize;
            let processor = match (at(header)?, half(header.checked_add(4)?)?) {
                ([b'P', b'E', 0, 0], 0x014c) => "x86",
                ([b'P', b'E', 0, 0], 0x01c4) => "arm",
                ([b'P', b'E', 0, 0], 0x8664) => "x86_64",
                ([b'P', b'E', 0, 0], 0xaa64) => "aarch64",
                _ => return None,
            };
            ("Windows", vec![processor])
        }
        [0xce | 0xcf, 0xfa, 0xed, 0xfe] => ("macOS", vec![mach(number(4)?)?]),
        // A universal binary: the number of processors, then 20 bytes for each.
        [0xca, 0xfe, 0xba, 0xbe] => {
            let count = u32::from_be_bytes(at(4)?).min(16) as usize;
            let processors = (0..count).map(|index| mach(u32::from_be_bytes(at(8 + 20 * index)?)));
            ("macOS", processors.collect::<Option<_>>()?)
        }
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::target_of;

    /// Checks headers that this test creates as the specifications describe them. The tests of the Python package check files that
    /// linkers wrote.
    #[test]
    fn headers() {
        let elf = |class, order, machine: [u8; 2]| {
            let mut bytes = [b"\x7fELF".as_slice(), &[class, order], &[0; 12], &machine].concat();
            bytes.resize(64, 0);
            target_of(&bytes).expect("ELF")
        };
        assert_eq!(elf(2, 1, [62, 0]), ("Linux", vec!["x86_64"]));
        assert_eq!(elf(1, 1, [243, 0]), ("Linux", vec!["riscv32"]));
        assert_eq!(elf(2, 2, [0, 22]), ("Linux", vec!["s390x"]));
        assert_eq!(elf(2, 1, [2, 1]), ("Linux", vec!["loongarch64"]));
        let mach = [&[0xcf, 0xfa, 0xed, 0xfe, 0x0c, 0, 0, 1][..], &[0; 24]].concat();
        assert_eq!(target_of(&mach), Some(("macOS", vec!["aarch64"])));
        // In a truncated file, nothing beyond its end may be read.
        let mut pe = vec![0; 0x48];
        pe[..2].copy_from_slice(b"MZ");
        pe[0x3c] = 0x40;
        pe[0x40..0x46].copy_from_slice(b"PE\0\0\x64\xaa");
        assert_eq!(target_of(&pe), Some(("Windows", vec!["aarch64"])));
        for bytes in [&pe[..], &mach, b"\xca\xfe\xba\xbe\0\0\0\x02", b"MZ", b"#!/bin/sh\n"] {
            for length in 0..bytes.len() {
                let _ = target_of(&bytes[..length]);
            }
        }
        pe[0x3c..0x40].fill(0xff);
        assert_eq!(target_of(&pe), None);
    }
}
