//! The directories in `binaries/` (section 2.3 of FMI 2.0, 2.5.1.4.1 of FMI 3.0).

use anyhow::{Result, bail};
use fmi_abi::Standard;
use std::fmt;

/// A platform that an FMU's library is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Platform {
    /// Processor and operating system as Rust names them.
    architecture: &'static str,
    system: &'static str,
    /// The directories in FMI 2.0 and in FMI 3.0.
    directories: [&'static str; 2],
    library_suffix: &'static str,
}

/// FMI 2.0 has names for x86; for other processors it refers to the platform tuples of FMI 3.0.
#[rustfmt::skip]
const PLATFORMS: [Platform; 8] = [
    Platform { architecture: "x86_64", system: "linux", directories: ["linux64", "x86_64-linux"], library_suffix: ".so" },
    Platform { architecture: "x86", system: "linux", directories: ["linux32", "x86-linux"], library_suffix: ".so" },
    Platform { architecture: "aarch64", system: "linux", directories: ["aarch64-linux", "aarch64-linux"], library_suffix: ".so" },
    Platform { architecture: "x86_64", system: "windows", directories: ["win64", "x86_64-windows"], library_suffix: ".dll" },
    Platform { architecture: "x86", system: "windows", directories: ["win32", "x86-windows"], library_suffix: ".dll" },
    Platform { architecture: "aarch64", system: "windows", directories: ["aarch64-windows", "aarch64-windows"], library_suffix: ".dll" },
    Platform { architecture: "x86_64", system: "macos", directories: ["darwin64", "x86_64-darwin"], library_suffix: ".dylib" },
    Platform { architecture: "aarch64", system: "macos", directories: ["aarch64-darwin", "aarch64-darwin"], library_suffix: ".dylib" },
];

impl Platform {
    /// The platform that this program runs on.
    ///
    /// # Errors
    /// When FMI has no directory for it.
    pub fn host() -> Result<Self> {
        Self::of(std::env::consts::ARCH, std::env::consts::OS)
    }

    /// The platform of a Rust target, for example `x86_64-pc-windows-gnu`.
    ///
    /// # Errors
    /// When no platform is known for the target.
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

    /// The platform with this directory in FMI 2.0 or in FMI 3.0.
    ///
    /// # Errors
    /// When there is none; the message lists the names.
    pub fn of_directory(name: &str) -> Result<Self> {
        Self::find(|platform| platform.directories.contains(&name)).ok_or_else(|| {
            let [in_fmi2, in_fmi3] =
                [0, 1].map(|fmi| PLATFORMS.map(|platform| platform.directories[fmi]).join(", "));
            anyhow::anyhow!(
                "'{name}' is not a platform of FMI 2.0 or FMI 3.0; platforms are {in_fmi2}, or {in_fmi3} in FMI 3.0"
            )
        })
    }

    /// The name of the directory.
    pub fn directory(self, fmi: Standard) -> &'static str {
        self.directories[fmi as usize]
    }

    /// The name of the library file of a model, which importers derive from the `modelIdentifier`.
    pub fn library_name(self, model_identifier: &str) -> String {
        format!("{model_identifier}{}", self.library_suffix)
    }

    /// Whether both have the same operating system, on any processor.
    pub fn same_system(self, other: Self) -> bool {
        self.system == other.system
    }

    /// The platform of a processor and an operating system as Rust names them, such as `x86_64` and `macos`.
    ///
    /// # Errors
    /// When FMI has no directory for them.
    pub fn of(architecture: &str, system: &str) -> Result<Self> {
        Self::find(|platform| (platform.architecture, platform.system) == (architecture, system))
            .ok_or_else(|| anyhow::anyhow!("no FMU platform is known for {architecture} with {system}"))
    }

    fn find(is_found: impl Fn(&Self) -> bool) -> Option<Self> {
        PLATFORMS.into_iter().find(is_found)
    }
}

/// The name of the directory in FMI 2.0.
impl fmt::Display for Platform {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.directory(Standard::Fmi2))
    }
}

#[cfg(test)]
mod tests {
    use super::Platform;
    use fmi_abi::Standard;

    #[test]
    fn targets_have_their_directories() {
        for (triple, directory, in_fmi3, library) in [
            ("x86_64-unknown-linux-gnu", "linux64", "x86_64-linux", "m.so"),
            ("aarch64-unknown-linux-gnu", "aarch64-linux", "aarch64-linux", "m.so"),
            ("x86_64-pc-windows-gnu", "win64", "x86_64-windows", "m.dll"),
            ("x86_64-pc-windows-msvc", "win64", "x86_64-windows", "m.dll"),
            ("i686-pc-windows-msvc", "win32", "x86-windows", "m.dll"),
            ("x86_64-apple-darwin", "darwin64", "x86_64-darwin", "m.dylib"),
            ("aarch64-apple-darwin", "aarch64-darwin", "aarch64-darwin", "m.dylib"),
        ] {
            let platform = Platform::of_target(triple).unwrap();
            assert_eq!(platform.to_string(), directory);
            assert_eq!(platform.directory(Standard::Fmi3), in_fmi3);
            assert_eq!(platform.library_name("m"), library);
            for name in [directory, in_fmi3] {
                assert_eq!(Platform::of_directory(name).unwrap(), platform);
            }
        }
    }

    #[test]
    fn unknown_platforms_are_named() {
        for triple in ["riscv64gc-unknown-linux-gnu", "x86_64-unknown-linux-musl", "nonsense"] {
            assert!(Platform::of_target(triple).is_err(), "{triple}");
        }
        let error = Platform::of_directory("linux").unwrap_err().to_string();
        assert!(
            error.contains("'linux'") && error.contains("linux64") && error.contains("x86-linux"),
            "{error}"
        );
    }
}
