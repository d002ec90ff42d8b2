//! Compiles the guid, a hash of the sources, into the library.

fn main() {
    let sources = fmu_package::Sources::of_package(env!("CARGO_MANIFEST_DIR"));
    if let Err(error) = fmu_package::build_script(&sources, Vec::new()) {
        println!("cargo::error={error:#}");
    }
}
