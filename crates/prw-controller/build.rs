//! Compiles the guid into the library.

#[path = "src/sources.rs"]
mod sources;

fn main() {
    if let Err(error) = fmu_package::build_script(&sources::sources(env!("CARGO_MANIFEST_DIR")), Vec::new()) {
        println!("cargo::error={error:#}");
    }
}
