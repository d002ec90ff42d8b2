//! The folders of `binaries/` (section 2.3).

use anyhow::{Result, bail};
use std::fmt;

/// A platform that an FMU's library is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Platform {
    /// Processor and operating system as Rust names them.
    architecture: &'static str,
    system: &'static str,
    folder: &'static str,
    library_suffix: &'static str,
}

/// Section 2.3 has names for x86; for the rest it refers to the platform tuples of FMI 3.0, section
/// 2.5.1.4.1.
#[rustfmt::skip]
const PLATFORMS: [Platform; 8] = [
    Platform { architecture: "x86_64", system: "linux", folder: "linux64", library_suffix: ".so" },
    Platform { architecture: "x86", system: "linux", folder: "linux32", library_suffix: ".so" },
    Platform { architecture: "aarch64", system: "linux", folder: "aarch64-linux", library_suffix: ".so" },
    Platform { architecture: "x86_64", system: "windows", folder: "win64", library_suffix: ".dll" },
    Platform { architecture: "x86", system: "windows", folder: "win32", library_suffix: ".dll" },
    Platform { architecture: "aarch64", system: "windows", folder: "aarch64-windows", library_suffix: ".dll" },
    Platform { architecture: "x86_64", system: "macos", folder: "darwin64", library_suffix: ".dylib" },
    Platform { architecture: "aarch64", system: "macos", folder: "aarch64-darwin", library_suffix: ".dylib" },
];

impl Platform {
    /// The platform that this program runs on.
    ///
    /// # Errors
    /// When FMI has no folder for it.
    pub fn host() -> Result<Self> {
        Self::of(std::env::consts::ARCH, std::env::consts::OS)
    }

    /// The platform of a Rust target, for example `x86_64-pc-windows-gnu`.
    ///
    /// # Errors
    /// When the target is unknown here.
    pub fn of_target(triple: &str) -> Result<Self> {
        let architecture = match triple.split('-').next() {
            Some("i586" | "i686") => "x86",
            Some(other) => other,
            None => "",
        };
        let system = if triple.contains("-darwin") {
            "macos"
        } else if triple.contains("-windows-") {
            "windows"
        } else if triple.contains("-linux-gnu") {
            "linux"
        } else {
            bail!(
                "no FMU platform is known for the target '{triple}'; targets are Linux (gnu), Windows and macOS"
            );
        };
        Self::of(architecture, system)
    }

    /// The platform with this folder name.
    ///
    /// # Errors
    /// When there is none; the message lists the names.
    pub fn of_folder(folder: &str) -> Result<Self> {
        Self::find(|platform| platform.folder == folder).ok_or_else(|| {
            let known = PLATFORMS.map(|platform| platform.folder).join(", ");
            anyhow::anyhow!("'{folder}' is no platform of FMI 2.0; platforms are {known}")
        })
    }

    /// The name of the library file of a model, which importers derive from the `modelIdentifier`.
    pub fn library_name(self, model_identifier: &str) -> String {
        format!("{model_identifier}{}", self.library_suffix)
    }

    /// Whether both have the same operating system, on whatever processor.
    pub fn same_system(self, other: Self) -> bool {
        self.system == other.system
    }

    /// The platform of a processor and an operating system as Rust names them, such as `x86_64` and `macos`.
    ///
    /// # Errors
    /// When FMI has no folder for them.
    pub fn of(architecture: &str, system: &str) -> Result<Self> {
        Self::find(|platform| (platform.architecture, platform.system) == (architecture, system))
            .ok_or_else(|| anyhow::anyhow!("no FMU platform is known for {architecture} with {system}"))
    }

    fn find(is_it: impl Fn(&Self) -> bool) -> Option<Self> {
        PLATFORMS.into_iter().find(is_it)
    }
}

/// The name of the folder.
impl fmt::Display for Platform {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.folder)
    }
}

#[cfg(test)]
mod tests {
    use super::Platform;

    #[test]
    fn targets_have_their_folders() {
        for (triple, folder, library) in [
            ("x86_64-unknown-linux-gnu", "linux64", "m.so"),
            ("aarch64-unknown-linux-gnu", "aarch64-linux", "m.so"),
            ("x86_64-pc-windows-gnu", "win64", "m.dll"),
            ("x86_64-pc-windows-msvc", "win64", "m.dll"),
            ("i686-pc-windows-msvc", "win32", "m.dll"),
            ("x86_64-apple-darwin", "darwin64", "m.dylib"),
            ("aarch64-apple-darwin", "aarch64-darwin", "m.dylib"),
        ] {
            let platform = Platform::of_target(triple).unwrap();
            assert_eq!(
                (platform.to_string().as_str(), platform.library_name("m").as_str()),
                (folder, library)
            );
            assert_eq!(Platform::of_folder(folder).unwrap(), platform);
        }
    }

    #[test]
    fn unknown_platforms_are_named() {
        for triple in ["riscv64gc-unknown-linux-gnu", "x86_64-unknown-linux-musl", "nonsense"] {
            assert!(Platform::of_target(triple).is_err(), "{triple}");
        }
        let error = Platform::of_folder("linux").unwrap_err().to_string();
        assert!(error.contains("'linux'") && error.contains("linux64"), "{error}");
    }
}
