//! Names of all functions, and the types of their arguments for use at run time.

use crate::{Rule, Standard, fmi2, fmi3};

/// Name and type of an argument.
#[derive(Debug)]
pub struct Argument {
    /// Name of the argument.
    pub name: &'static str,
    /// Type of the argument, as written in `fmi-abi`.
    pub of: &'static str,
}

impl Argument {
    /// For a type that is written as a pointer, returns the type of its target without the prefix `fmi2` or `fmi3`, and
    /// whether the function only reads the target. Returns `None` for other types, including handles such as
    /// `fmi2FMUstate`.
    pub fn pointee(&self) -> Option<(&'static str, bool)> {
        // Macro expansion may add a space after the asterisk.
        let (mutability, of) = self.of.strip_prefix('*')?.trim_start().split_once(' ')?;
        Some((
            of.strip_prefix("fmi2").or_else(|| of.strip_prefix("fmi3")).unwrap_or(of),
            mutability == "const",
        ))
    }
}

/// Signature of a function that takes an instance and returns a status.
#[derive(Debug)]
pub struct Signature {
    /// States in which the function may be called.
    pub rule: &'static Rule,
    /// Arguments after the instance.
    pub arguments: &'static [Argument],
}

/// Returns the signatures of the functions that take an instance and return a status, in the order of `Function` of the FMI version.
pub const fn signatures(standard: Standard) -> &'static [Signature] {
    match standard {
        Standard::Fmi2 => fmi2::Functions::SIGNATURES,
        Standard::Fmi3 => fmi3::Functions::SIGNATURES,
    }
}

/// Returns the names of all other functions: versions, creation and release of instances.
pub const fn without_instance(standard: Standard) -> &'static [&'static str] {
    match standard {
        Standard::Fmi2 => fmi2::Functions::WITHOUT_INSTANCE,
        Standard::Fmi3 => fmi3::Functions::WITHOUT_INSTANCE,
    }
}

/// Returns the signature of the function with this name; `None` if no function that takes an instance and returns a
/// status has this name.
pub fn signature(name: &str) -> Option<&'static Signature> {
    let standard = if name.starts_with("fmi3") { Standard::Fmi3 } else { Standard::Fmi2 };
    signatures(standard).iter().find(|of| of.rule.name == name)
}
