//! The pages of the testbed and of its controller: `documentation/index.html` in their FMUs, and `manual.html` next to it. They are put together from the text,
//! figures and numbers in `docs/fmu-page`, the tables in `docs`, and the model description of the FMU that is built.

mod formulas;
mod markdown;
mod tables;

use anyhow::{Context, Result, anyhow, bail, ensure};
use minijinja::{AutoEscape, Environment, Error, ErrorKind, UndefinedBehavior, context};
use roxmltree::Document;
use serde_json::Value as Json;
use std::fs;
use std::path::{Path, PathBuf};

/// The repository root.
const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
/// The directory of the text, the figures and the numbers.
const SOURCES: &str = "docs/fmu-page";
/// Table 1 as the paper prints it.
const PRINTED: &str = "modelDescription/parameters.json";

/// The scripts that draw the wrist on both pages.
pub const WRIST: [&str; 3] = [
    include_str!("../../../docs/fmu-page/wrist/wrist.js"),
    concat!("WRIST = ", include_str!("../../../docs/fmu-page/wrist/wrist.json"), ";\n"),
    include_str!("../../../docs/fmu-page/wrist/view.js"),
];

/// Returns the testbed's first page for the FMU with this model description of FMI 2.0. It tells what the testbed is; the story of the
/// machine is added to it by the scripts that run the FMU.
///
/// # Errors
/// When a source is missing or faulty; the message names it.
///
/// ```
/// let description = std::fs::read_to_string("../../modelDescription/modelDescription.xml").unwrap();
/// assert!(prw_page::testbed(&description).unwrap().contains("<a href=\"manual.html#equations\">"));
/// ```
pub fn testbed(description: &str) -> Result<String> {
    page("testbed", Extent::First, description)
}

/// Returns the testbed's manual for the FMU with this model description of FMI 2.0.
///
/// # Errors
/// When a source is missing or faulty; the message names it.
///
/// ```
/// let description = std::fs::read_to_string("../../modelDescription/modelDescription.xml").unwrap();
/// assert!(prw_page::manual(&description).unwrap().contains("<td><code>theta1</code></td><td>rad</td>"));
/// ```
pub fn manual(description: &str) -> Result<String> {
    page("testbed", Extent::Manual, description)
}

/// Returns the controller's page for the FMU with this model description of FMI 2.0.
///
/// # Errors
/// When a source is missing or faulty; the message names it.
///
/// ```
/// let description = std::fs::read_to_string("../../examples/controller/modelDescription/modelDescription.xml").unwrap();
/// assert!(prw_page::controller(&description).unwrap().contains("<td><code>pitch_ref</code></td><td>rad</td>"));
/// ```
pub fn controller(description: &str) -> Result<String> {
    page("controller", Extent::Whole, description)
}

/// The sections of a document that a page contains.
#[derive(Clone, Copy, PartialEq)]
enum Extent {
    Whole,
    /// The first section, and links to the others.
    First,
    /// All sections but the first.
    Manual,
}

/// A section of a page.
struct Section {
    anchor: String,
    /// In HTML.
    title: String,
    /// In HTML, with formulas as MathML.
    text: String,
}

/// Builds a page from the files in one directory of `text` and from the model description.
fn page(directory: &str, extent: Extent, description: &str) -> Result<String> {
    let document = Document::parse(description).context("the model description is not XML")?;
    let root = document.root_element();
    let attribute = |name| root.attribute(name).unwrap_or_default();
    let environment = environment(&document)?;
    let sections = section_files(&source("text").join(directory))?;
    let sections: Vec<_> = sections.iter().map(|path| section(&environment, path)).collect::<Result<_>>()?;
    let [header, all @ ..] = &sections[..] else { bail!("{directory} has no text") };
    let (first, rest) = all.split_at(all.len().min(1));
    let links = |sections: &[Section], page: &str| -> Vec<(String, String)> {
        sections.iter().map(|one| (format!("{page}#{}", one.anchor), one.title.clone())).collect()
    };
    let (sections, links) = match extent {
        Extent::Whole => (all, links(all, "")),
        Extent::First => (first, [links(first, ""), links(rest, "manual.html")].concat()),
        Extent::Manual => (rest, links(rest, "")),
    };
    let (title, lead) = match extent {
        Extent::Manual => (
            format!("{}: the manual", header.title),
            "<p><a href=\"index.html\">The machine, and this FMU running in the browser</a></p>".to_owned(),
        ),
        _ => (header.title.clone(), header.text.clone()),
    };
    let template = read(&source("page.html"))?;
    let page = environment.render_str(
        &template,
        context! {
            style => read(&source("style.css"))?,
            title => title,
            lead => lead,
            links => links,
            version => escape(attribute("version")),
            license => escape(attribute("license")),
            sections => sections.iter().map(|one| (&one.anchor, &one.title, &one.text)).collect::<Vec<_>>(),
        },
    );
    page.with_context(|| format!("{SOURCES}/page.html"))
}

/// Returns the values and functions of the templates.
fn environment(description: &Document) -> Result<Environment<'static>> {
    let numbers = json(&source("figures/numbers.json"))?;
    let printed = json(&Path::new(ROOT).join(PRINTED))?;
    let variables = tables::variables(description);
    let mut environment = Environment::new();
    environment.set_undefined_behavior(UndefinedBehavior::Strict);
    environment.set_auto_escape_callback(|_| AutoEscape::None);
    let root = description.root_element();
    let identifier = root.descendants().find_map(|node| node.attribute("modelIdentifier"));
    environment.add_global("identifier", escape(identifier.unwrap_or_default()));
    environment.add_global("description", escape(root.attribute("description").unwrap_or_default()));
    environment.add_global("drawing", read(&source("testbed.svg"))?);
    environment.add_global(
        "poles",
        context! { pitch => roots(&numbers["poles"]["pitch"]), roll => roots(&numbers["poles"]["roll"]) },
    );
    let zeros = numbers["zeros"].as_array().into_iter().flatten().rev().cloned().collect();
    environment.add_global("zeros", roots(&zeros));
    environment.add_global("n", minijinja::Value::from_serialize(&numbers));
    environment.add_function("minus", |number: minijinja::Value| minus(&number.to_string()));
    environment
        .add_function("figure", |name: &str, meaning: &str| figure(name, meaning).map_err(to_template));
    environment.add_function("program", |name: &str| program(name).map_err(to_template));
    environment.add_function("table_of", |path: &str, heading: &str| {
        markdown::table(&Path::new(ROOT).join(path), heading).map_err(to_template)
    });
    environment.add_function("order_table", move || tables::orders(&numbers));
    let of = variables.clone();
    environment.add_function("variable_table", move |causality: &str, title: &str| {
        tables::of_causality(&of, causality, title)
    });
    let of = variables.clone();
    environment.add_function("parameter_table", move || tables::parameters(&of, None));
    environment
        .add_function("parameter_table_as_printed", move || tables::parameters(&variables, Some(&printed)));
    Ok(environment)
}

/// Returns the files `N_NAME.html` in the order of their numbers.
fn section_files(directory: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(directory).with_context(|| format!("cannot read {}", directory.display()))? {
        let path = entry?.path();
        let name = path.file_stem().and_then(|name| name.to_str()).unwrap_or_default();
        let number: Option<u32> = name.split_once('_').and_then(|(number, _)| number.parse().ok());
        files.push((number.with_context(|| format!("{} must be N_NAME.html", path.display()))?, path));
    }
    files.sort();
    Ok(files.into_iter().map(|(_, path)| path).collect())
}

/// Reads a section: its title is a comment in the first line.
fn section(environment: &Environment, path: &Path) -> Result<Section> {
    let text = read(path)?;
    let shown = || path.display().to_string();
    let title =
        text.strip_prefix("{# title: ").and_then(|rest| rest.split_once(" #}\n")).map(|(title, _)| title);
    let title = title.with_context(|| format!("{}: the first line must be {{# title: ... #}}", shown()))?;
    let name = path.file_stem().and_then(|name| name.to_str()).unwrap_or_default();
    let rendered = environment.render_str(&text, ()).map_err(|error| anyhow!("{}: {error:#}", shown()))?;
    Ok(Section {
        anchor: name.split_once('_').map_or(name, |(_, anchor)| anchor).to_owned(),
        title: escape(title),
        text: formulas::typeset(&rendered).with_context(shown)?.trim().to_owned(),
    })
}

/// Returns a figure's SVG for the page, with a description.
fn figure(name: &str, meaning: &str) -> Result<String> {
    let start = format!("<svg class=\"plot\" role=\"img\" aria-label=\"{}\"", escape(meaning));
    let svg = read(&source("figures").join(format!("{name}.svg")))?;
    Ok(svg.trim().replacen("<svg xmlns=\"http://www.w3.org/2000/svg\"", &start, 1))
}

/// Returns a program, which the tests run unchanged.
fn program(name: &str) -> Result<String> {
    let text = read(&source("programs").join(format!("{name}.py")))?;
    Ok(format!("<pre data-run=\"{name}\" tabindex=\"0\"><code>{}</code></pre>", escape_text(text.trim())))
}

/// Returns real and conjugate complex numbers as text: −174.87 and −9.68 ± 34.68 i.
fn roots(pairs: &Json) -> String {
    let part = |pair: &Json, index: usize| pair[index].as_f64().unwrap_or(f64::NAN);
    let one = |pair: &Json| match (part(pair, 0), part(pair, 1)) {
        (real, 0.0) => format!("{real:.2}"),
        (real, imaginary) => format!("{real:.2} ± {imaginary:.2} i"),
    };
    minus(&pairs.as_array().into_iter().flatten().map(one).collect::<Vec<_>>().join(" and "))
}

/// Returns numbers with the mathematical minus sign.
fn minus(numbers: &str) -> String {
    numbers.replace('-', "\u{2212}")
}

/// Escapes a string for the content of an element.
fn escape_text(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// Escapes a string for an attribute, too.
fn escape(text: &str) -> String {
    escape_text(text).replace('"', "&quot;").replace('\'', "&#x27;")
}

fn to_template(error: anyhow::Error) -> Error {
    Error::new(ErrorKind::InvalidOperation, format!("{error:#}"))
}

fn source(name: &str) -> PathBuf {
    Path::new(ROOT).join(SOURCES).join(name)
}

/// Reads a text file; a checkout on Windows may have other line ends.
fn read(path: &Path) -> Result<String> {
    let text = fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    ensure!(!text.is_empty(), "{} is empty", path.display());
    Ok(text.replace("\r\n", "\n"))
}

fn json(path: &Path) -> Result<Json> {
    serde_json::from_str(&read(path)?).with_context(|| path.display().to_string())
}
