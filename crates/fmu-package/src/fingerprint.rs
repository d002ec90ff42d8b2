//! The guid, a hash of everything in the FMU.

use sha2::{Digest, Sha256};

/// Collects named pieces of content and hashes them to a guid.
///
/// Some importers keep unpacked FMUs by guid, so different content must have a different guid, and the same content the same guid.
///
/// ```
/// use fmu_package::Fingerprint;
///
/// let mut fingerprint = Fingerprint::new();
/// fingerprint.add("src/lib.rs", b"fn main() {}");
/// assert_eq!(fingerprint.guid().len(), 38);
/// ```
#[derive(Clone, Default)]
pub struct Fingerprint(Sha256);

impl Fingerprint {
    /// A fingerprint without pieces.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a piece. Lengths are hashed as well, so that different lists of pieces have different hashes.
    pub fn add(&mut self, name: &str, content: &[u8]) {
        for bytes in [name.as_bytes(), content] {
            self.0.update((bytes.len() as u64).to_le_bytes());
            self.0.update(bytes);
        }
    }

    /// The fingerprint in the form `{8-4-4-4-12}`, a UUID of version 8 (RFC 9562, section 5.8).
    pub fn guid(&self) -> String {
        let digest = self.0.clone().finalize();
        let mut uuid = [0; 16];
        uuid.copy_from_slice(&digest[..16]);
        uuid[6] = 0x80 | uuid[6] & 0x0f;
        uuid[8] = 0x80 | uuid[8] & 0x3f;
        let hex: String = uuid.iter().map(|byte| format!("{byte:02x}")).collect();
        format!("{{{}-{}-{}-{}-{}}}", &hex[..8], &hex[8..12], &hex[12..16], &hex[16..20], &hex[20..])
    }
}

#[cfg(test)]
mod tests {
    use super::Fingerprint;

    fn guid(pieces: &[(&str, &str)]) -> String {
        let mut fingerprint = Fingerprint::new();
        for (name, content) in pieces {
            fingerprint.add(name, content.as_bytes());
        }
        fingerprint.guid()
    }

    #[test]
    fn it_is_stable_and_has_the_form_of_a_uuid() {
        // From Python: sha256(pack('<Q', 1) + b'a' + pack('<Q', 2) + b'bc').digest()[:16]
        assert_eq!(guid(&[("a", "bc")]), "{9a8acca1-b6c6-80be-bd3f-bc756aed625d}");
    }

    #[test]
    fn the_guid_depends_on_the_boundaries_between_names_and_contents() {
        let all = [
            guid(&[("a", "bc")]),
            guid(&[("ab", "c")]),
            guid(&[("a", "b"), ("c", "")]),
            guid(&[("c", ""), ("a", "b")]),
        ];
        for (i, one) in all.iter().enumerate() {
            assert!(!all[i + 1..].contains(one), "{all:?}");
        }
    }
}
