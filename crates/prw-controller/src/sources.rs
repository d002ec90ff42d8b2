//! What the FMU of the controller is made from; its guid is a hash of that.

use fmi2_package::Sources;

/// The files that the library and its description are made from.
pub fn sources() -> Sources {
    Sources {
        code: vec![
            "Cargo.toml",
            "build.rs",
            "build_fmu.rs",
            "src",
            "../fmi2-export/Cargo.toml",
            "../fmi2-export/src",
            "../fmi2-package/Cargo.toml",
            "../fmi2-package/src",
        ],
        licenses: vec!["../../LICENSE-APACHE", "../../LICENSE-MIT"],
        ..Sources::of_package(env!("CARGO_MANIFEST_DIR"))
    }
}
