//! Compares the memory that readers need with the size of the files, for families of files: if a reader copied a part for each use, a
//! small file would need much memory.

use fmu_run::Description;
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Allocates memory, and counts it.
struct Counting;

static USED: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

#[allow(unsafe_code, reason = "an allocator")]
// SAFETY: the allocator of the system allocates and frees.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let used = USED.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        PEAK.fetch_max(used, Ordering::Relaxed);
        // SAFETY: the caller guarantees the layout.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        USED.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller guarantees that the pointer comes from `alloc`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Memory for each byte of a file, and for any file, in bytes. A variable of 60 bytes of XML takes about 1500.
const PER_BYTE: usize = 40;
const ANY: usize = 1 << 18;
/// Limit for the elements of all arrays, in bytes.
const ELEMENTS: usize = 512 << 20;

fn repeated(count: usize, text: impl Fn(usize) -> String) -> String {
    (0..count).map(text).collect()
}

fn description(version: &str, types: &str, variables: &str, structure: &str) -> String {
    let token = if version == "2.0" { "guid" } else { "instantiationToken" };
    format!(
        "<fmiModelDescription fmiVersion=\"{version}\" modelName=\"M\" {token}=\"x\"><CoSimulation modelIdentifier=\"m\"/>\
        <TypeDefinitions>{types}</TypeDefinitions><ModelVariables>{variables}</ModelVariables>\
        <ModelStructure>{structure}</ModelStructure></fmiModelDescription>"
    )
}

/// Returns a description with `types` types of `letters` letters and `variables` variables.
fn of_types(attribute: &str, types: usize, letters: usize, variables: usize) -> String {
    let long = "u".repeat(letters);
    let of = repeated(types, |k| match attribute {
        "items" => {
            let item = format!("<Item name=\"{}\" value=\"1\"/>", "i".repeat(20)).repeat(letters / 40);
            format!("<SimpleType name=\"T{k}\"><Enumeration>{item}</Enumeration></SimpleType>")
        }
        "min" => format!("<SimpleType name=\"T{k}\"><Real min=\"1.{}\"/></SimpleType>", "0".repeat(letters)),
        _ => format!("<SimpleType name=\"T{k}\"><Real {attribute}=\"{long}\"/></SimpleType>"),
    });
    let each = repeated(variables, |k| {
        let of = k % types;
        format!(
            "<ScalarVariable name=\"v{k}\" valueReference=\"{k}\"><Real declaredType=\"T{of}\"/></ScalarVariable>"
        )
    });
    description("2.0", &of, &each, "")
}

/// Returns a description with arrays that have long texts.
fn of_arrays(arrays: usize, letters: usize, elements: usize) -> String {
    let long = "d".repeat(letters);
    let array = |k: usize| {
        format!(
            "<Float64 name=\"a{k}\" valueReference=\"{k}\" description=\"{long}\" unit=\"{long}\" start=\"1.{}\">\
            <Dimension start=\"{elements}\"/></Float64>",
            "0".repeat(letters)
        )
    };
    description("3.0", "", &repeated(arrays, array), "")
}

/// Returns a description with `count` derivatives of a variable whose name has `letters` letters.
fn of_derivatives(letters: usize, count: usize) -> String {
    let variable = |name: &str, k: usize, derivative: &str| {
        format!("<ScalarVariable name=\"{name}\" valueReference=\"{k}\"><Real{derivative}/></ScalarVariable>")
    };
    let each = repeated(count, |k| variable(&format!("d{k}"), k + 1, " derivative=\"1\""));
    description("2.0", "", &(variable(&"x".repeat(letters), 0, "") + &each), "")
}

/// Returns a description in which outputs depend on arrays.
fn of_dependencies(outputs: usize, dependencies: usize, elements: usize) -> String {
    let array =
        format!("<Float64 name=\"a\" valueReference=\"0\"><Dimension start=\"{elements}\"/></Float64>");
    let output =
        |k: usize| format!("<Float64 name=\"y{k}\" valueReference=\"{}\" causality=\"output\"/>", k + 1);
    let on = "0 ".repeat(dependencies);
    let unknown = |k: usize| format!("<Output valueReference=\"{}\" dependencies=\"{on}\"/>", k + 1);
    description("3.0", "", &(array + &repeated(outputs, output)), &repeated(outputs, unknown))
}

#[test]
fn memory_grows_with_the_file() {
    let mut families = Vec::new();
    for attribute in ["unit", "displayUnit", "quantity", "min", "items"] {
        for (types, letters, variables) in [(1, 100_000, 1000), (1, 1000, 10_000), (100, 1000, 1000)] {
            let name = format!("{types} types with {letters} letters of {attribute}, {variables} variables");
            families.push((name, of_types(attribute, types, letters, variables), 0));
        }
    }
    for (arrays, letters, elements) in [(1, 10_000, 100_000), (100, 1000, 10_000), (1, 100, 1 << 30)] {
        let name = format!("{arrays} arrays with {letters} letters and {elements} elements");
        families.push((name, of_arrays(arrays, letters, elements), ELEMENTS));
    }
    for (outputs, dependencies, elements) in [(1000, 10, 1000), (10, 10_000, 1000), (1000, 1, 10_000)] {
        let name = format!("{outputs} outputs that depend {dependencies} times on {elements} elements");
        families.push((name, of_dependencies(outputs, dependencies, elements), 400 * elements));
    }
    for (letters, count) in [(100_000, 1000), (1000, 10_000)] {
        families.push((
            format!("{count} derivatives of {letters} letters"),
            of_derivatives(letters, count),
            0,
        ));
    }
    for (name, text, more) in families {
        let before = USED.load(Ordering::Relaxed);
        PEAK.store(before, Ordering::Relaxed);
        let read = Description::parse(&text);
        let peak = PEAK.load(Ordering::Relaxed) - before;
        assert!(read.is_ok(), "{name}: {:?}", read.err());
        println!("{name}: {} bytes of XML, {peak} bytes of memory", text.len());
        assert!(
            peak <= PER_BYTE * text.len() + ANY + more,
            "{name}: {peak} bytes for {} bytes of XML",
            text.len()
        );
    }
}
