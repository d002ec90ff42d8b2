//! The mistake of a model, whose name is in a file of its resources, so that one library serves all mistakes.

use fmu_export::Setup;
use std::sync::OnceLock;

static MISTAKE: OnceLock<String> = OnceLock::new();

pub fn mistake() -> &'static str {
    MISTAKE.get().map_or("", String::as_str)
}

pub fn read_mistake(setup: &Setup) {
    let path = setup.resources().map(|directory| directory.join("mistake"));
    MISTAKE.get_or_init(|| path.and_then(|path| std::fs::read_to_string(path).ok()).unwrap_or_default());
}
