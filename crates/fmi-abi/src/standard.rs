//! FMI versions and interface types.

use std::ffi::CString;
use std::fmt;
use std::path::Path;

/// FMI version of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standard {
    /// FMI 2.0.
    Fmi2 = 0,
    /// FMI 3.0.
    Fmi3 = 1,
}

impl Standard {
    /// Returns the value reference that fmu-export assigns to the variable at this index of a model's table: the
    /// index itself in FMI 2.0, and the index plus 1 in FMI 3.0.
    pub const fn reference(self, index: u32) -> u32 {
        index.wrapping_add(self as u32)
    }

    /// Returns the location of the resources as importers write it: a URI in FMI 2.0 (section 2.1.5), a path with a
    /// final separator in FMI 3.0 (section 2.3.1). Returns an empty string if the path contains NUL.
    pub fn resources(self, directory: &Path) -> CString {
        let resources = match self {
            Self::Fmi2 => uri(&directory.to_string_lossy()),
            Self::Fmi3 => format!("{}{}", directory.display(), std::path::MAIN_SEPARATOR),
        };
        CString::new(resources).unwrap_or_default()
    }
}

impl fmt::Display for Standard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Fmi2 => "FMI 2.0",
            Self::Fmi3 => "FMI 3.0",
        })
    }
}

/// Interface type of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interface {
    /// Model Exchange: the importer integrates.
    ModelExchange = 0,
    /// Co-Simulation: the FMU performs its own steps.
    CoSimulation = 1,
}

impl fmt::Display for Interface {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::ModelExchange => "Model Exchange",
            Self::CoSimulation => "Co-Simulation",
        })
    }
}

fn uri(path: &str) -> String {
    let mut uri = "file://".to_owned();
    let path = path.replace('\\', "/");
    if !path.starts_with('/') {
        uri.push('/');
    }
    for byte in path.bytes() {
        match byte {
            b'/' | b':' | b'-' | b'.' | b'_' | b'~' => uri.push(byte.into()),
            byte if byte.is_ascii_alphanumeric() => uri.push(byte.into()),
            byte => uri.push_str(&format!("%{byte:02X}")),
        }
    }
    uri
}

#[cfg(test)]
mod tests {
    #[test]
    fn locations() {
        assert_eq!(super::uri("/tmp/a b/%"), "file:///tmp/a%20b/%25");
        assert_eq!(super::uri(r"C:\temp\r"), "file:///C:/temp/r");
    }
}
