//! Generates files, most of them malformed, which a reader must survive. They are as small as their purpose permits.

use std::io::{Cursor, Write};
use zip::write::SimpleFileOptions;

/// Files of one kind, with their names.
pub type Files = Vec<(&'static str, Vec<u8>)>;

fn description(version: u8, attributes: &str, interface: &str, rest: &str) -> Vec<u8> {
    let (token, version) = if version == 2 { ("guid", "2.0") } else { ("instantiationToken", "3.0") };
    format!(
        "<fmiModelDescription fmiVersion=\"{version}\" modelName=\"M\" {token}=\"x\" {attributes}>{interface}{rest}</fmiModelDescription>"
    )
    .into_bytes()
}

const CS: &str = "<CoSimulation modelIdentifier=\"m\"/>";

fn fmi2(variables: &str, structure: &str) -> Vec<u8> {
    let rest =
        format!("<ModelVariables>{variables}</ModelVariables><ModelStructure>{structure}</ModelStructure>");
    description(2, "", CS, &rest)
}

fn fmi3(variables: &str, structure: &str) -> Vec<u8> {
    let rest =
        format!("<ModelVariables>{variables}</ModelVariables><ModelStructure>{structure}</ModelStructure>");
    description(3, "", CS, &rest)
}

/// Returns the declarations of `count` arrays, each with 100,000 elements.
fn arrays(count: usize, attributes: &str) -> String {
    let array = |number: usize| {
        format!(
            "<Float64 name=\"a{number}\" valueReference=\"{number}\" {attributes}><Dimension start=\"100000\"/></Float64>"
        )
    };
    (1..=count).map(array).collect()
}

/// Returns model descriptions of both FMI versions.
pub fn descriptions() -> Files {
    let deep = |tag: &str, count| format!("<{tag}>").repeat(count);
    let identifier =
        |name: &str| description(2, "", &format!("<CoSimulation modelIdentifier=\"{name}\"/>"), "");
    let attributes: String = (0..20_000).map(|number| format!(" a{number}=\"\"")).collect();
    let spaces: String = (0..2000).map(|number| format!(" xmlns:a{number}=\"{number}\"")).collect();
    let nested_spaces: String = (0..240).map(|number| format!("<a xmlns:a{number}=\"{number}\">")).collect();
    let long = "x".repeat(4000);
    let outputs: String =
        (2..60).map(|number| format!("<Output valueReference=\"{number}\" dependencies=\"1\"/>")).collect();
    let scalars: String = (2..60)
        .map(|number| {
            format!("<Float64 name=\"y{number}\" valueReference=\"{number}\" causality=\"output\"/>")
        })
        .collect();
    let of_type =
        "<ScalarVariable name=\"x\" valueReference=\"1\"><Real declaredType=\"T\"/></ScalarVariable>"
            .repeat(500);
    let items = "<Item name=\"i\" value=\"1\"/>".repeat(500);
    let types = format!(
        "<TypeDefinitions><SimpleType name=\"T\"><Enumeration unit=\"{long}\">{items}</Enumeration></SimpleType></TypeDefinitions>"
    );
    let states = |count: usize| "<ContinuousStateDerivative valueReference=\"1\"/>".repeat(count);
    vec![
        ("fmi2", fmi2("<ScalarVariable name=\"x\" valueReference=\"1\" causality=\"output\"><Real start=\"1\"/></ScalarVariable>", "<Outputs><Unknown index=\"1\" dependencies=\"\"/></Outputs>")),
        ("fmi3", fmi3("<Float64 name=\"x\" valueReference=\"1\" causality=\"output\" start=\"1 2\"><Dimension start=\"2\"/></Float64>", "<Output valueReference=\"1\"/>")),
        ("description of each element", fmi3(&arrays(4, &format!("description=\"{long}\"")), "")),
        ("unit of each element", fmi3(&arrays(4, &format!("unit=\"{long}\" displayUnit=\"{long}\" declaredType=\"{long}\"")), "")),
        ("name of each element", fmi3(&arrays(4, "").replace("name=\"a", &format!("name=\"{long}")), "")),
        ("start value of each element", fmi3(&arrays(12, &format!("start=\"1.{}\"", "0".repeat(1000))), "")),
        ("strings of each element", fmi3(&arrays(12, "").replace("Float64", "String").replace("<Dimension", &format!("<Start value=\"{long}\"/><Dimension")), "")),
        ("dependencies of each output", fmi3(&(arrays(1, "") + &scalars), &outputs)),
        ("dependencies of each element", fmi3(&arrays(2, "causality=\"output\""), "<Output valueReference=\"1\" dependencies=\"2 2 2 2\"/><Output valueReference=\"2\" dependencies=\"1 1 1\"/>")),
        ("dimensions that overflow", fmi3("<Float64 name=\"a\" valueReference=\"1\"><Dimension start=\"18446744073709551615\"/><Dimension start=\"18446744073709551615\"/></Float64>", "<EventIndicator valueReference=\"1\"/>")),
        ("sizes that overflow", fmi3(&arrays(4, "").replace("100000", "9223372036854775807"), &"<EventIndicator valueReference=\"1\"/><EventIndicator valueReference=\"2\"/><EventIndicator valueReference=\"3\"/>".repeat(2))),
        ("many dimensions", fmi3(&arrays(1, "").replace("<D", &("<Dimension start=\"1\"/>".repeat(10_000) + "<D")), "")),
        ("states", fmi3(&arrays(1, "derivative=\"1\""), &states(2000))),
        ("event indicators", description(2, "numberOfEventIndicators=\"18446744073709551615\"", "<ModelExchange modelIdentifier=\"m\"/>", "")),
        ("event indicators of arrays", fmi3(&arrays(1, ""), &"<EventIndicator valueReference=\"1\"/>".repeat(100))),
        ("types", description(2, "", CS, &format!("{types}<ModelVariables>{of_type}</ModelVariables>"))),
        ("attributes", description(2, &attributes, CS, "")),
        ("namespaces", description(2, &spaces, CS, &"<a xmlns:b=\"c\"/>".repeat(2000))),
        ("nested namespaces", description(2, "", CS, &nested_spaces)),
        ("nested elements", deep("a", 60_000).into_bytes()),
        ("entities", b"<!DOCTYPE a [<!ENTITY b \"&c;&c;&c;&c;\"><!ENTITY c \"&b;\">]><a>&b;</a>".to_vec()),
        ("entity of a file", b"<!DOCTYPE a [<!ENTITY b SYSTEM \"file:///etc/passwd\">]><a>&b;</a>".to_vec()),
        ("identifier with code", identifier("m(void){} int main(void){return system(&quot;x&quot;);} void f")),
        ("identifier with a path", identifier("../../../tmp/m")),
        ("identifier with a newline", identifier("m&#10;m")),
        ("control characters", description(2, "", "<CoSimulation/>", "<ModelVariables><ScalarVariable name=\"&#9;&#10;\u{9b}31m\u{202e}\"/></ModelVariables>")),
        ("long name", description(2, "", CS, &format!("<ModelVariables><ScalarVariable name=\"{}\"/></ModelVariables>", "n".repeat(100_000)))),
        ("version", description(2, "", CS, "").iter().copied().chain(b"<".iter().copied()).collect()),
        ("long version", format!("<fmiModelDescription fmiVersion=\"{}\"/>", "\u{85}".repeat(10_000)).into_bytes()),
        ("latin", b"<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?><a b=\"\xe4\"/>".to_vec()),
        ("half of UTF-16", b"\xff\xfe<\0a".to_vec()),
        ("NUL", vec![0; 1000]),
        ("empty", Vec::new()),
    ]
}

/// Returns the beginning of the description of a system with these elements; `closed` adds the connections and the end.
fn system(elements: &str, rest: &str) -> Vec<u8> {
    format!(
        "<ssd:SystemStructureDescription xmlns:ssd=\"http://ssp-standard.org/SSP1/SystemStructureDescription\" version=\"1.0\" name=\"S\">\
        <ssd:System name=\"s\">{rest}<ssd:Elements>{elements}</ssd:Elements>"
    )
    .into_bytes()
}

/// Adds connections to a system and closes its elements.
fn closed(mut text: Vec<u8>, connections: &str) -> Vec<u8> {
    let end = format!(
        "<ssd:Connections>{connections}</ssd:Connections></ssd:System></ssd:SystemStructureDescription>"
    );
    text.extend(end.into_bytes());
    text
}

fn component(name: &str, source: &str) -> String {
    format!("<ssd:Component name=\"{name}\" source=\"{source}\"/>")
}

fn connection(from: (&str, &str), to: (&str, &str)) -> String {
    format!(
        "<ssd:Connection startElement=\"{}\" startConnector=\"{}\" endElement=\"{}\" endConnector=\"{}\"/>",
        from.0, from.1, to.0, to.1
    )
}

/// Returns a system of components that are connected from output to input in a chain or, if `closes`, in a cycle.
pub fn chain(count: usize, closes: bool) -> Vec<u8> {
    let components: String = (0..count).map(|number| component(&format!("c{number}"), "m")).collect();
    let end = if closes { count } else { count - 1 };
    let connect = |number: usize| {
        let [from, to] = [number, (number + 1) % count].map(|number| format!("c{number}"));
        connection((&from, "y"), (&to, "u"))
    };
    closed(system(&components, ""), &(0..end).map(connect).collect::<String>())
}

/// Returns a system in which the value of an input is transformed, with `pairs` pairs, and then passed to `count` inner inputs.
fn fan(kind: &str, pairs: usize, count: usize) -> Vec<u8> {
    let connector = |name: &str| {
        format!("<ssd:Connector name=\"{name}\" kind=\"input\"><ssc:Enumeration name=\"E\"/></ssd:Connector>")
    };
    let each = |text: &dyn Fn(usize) -> String, count| (0..count).map(text).collect::<String>();
    let items = each(&|number| format!("<ssc:Item name=\"{number}\" value=\"{number}\"/>"), pairs);
    let entries = each(&|number| format!("<ssc:MapEntry source=\"{number}\" target=\"{number}\"/>"), pairs);
    let inner = each(&|number| connector(&format!("u{number}")), count);
    let links = each(
        &|number| {
            format!("<ssd:Connection startConnector=\"x\" endElement=\"j\" endConnector=\"u{number}\"/>")
        },
        count,
    );
    let of_system = |name: &str, connectors: &str, elements: &str, connections: &str| {
        format!(
            "<ssd:System name=\"{name}\"><ssd:Connectors>{connectors}</ssd:Connectors><ssd:Elements>{elements}</ssd:Elements>\
            <ssd:Connections>{connections}</ssd:Connections></ssd:System>"
        )
    };
    let i = of_system("i", &connector("x"), &of_system("j", &inner, "", ""), &links);
    let transformed = format!(
        "<ssd:Connection startConnector=\"x\" endElement=\"i\" endConnector=\"x\"><ssc:{kind}MappingTransformation>{entries}\
        </ssc:{kind}MappingTransformation></ssd:Connection>"
    );
    let root = of_system("s", &connector("x"), &(component("c", "m") + &i), &transformed);
    format!(
        "<ssd:SystemStructureDescription xmlns:ssd=\"http://ssp-standard.org/SSP1/SystemStructureDescription\" \
        xmlns:ssc=\"http://ssp-standard.org/SSP1/SystemStructureCommon\" version=\"1.0\" name=\"S\">{root}<ssd:Enumerations>\
        <ssc:Enumeration name=\"E\">{items}</ssc:Enumeration></ssd:Enumerations></ssd:SystemStructureDescription>"
    )
    .into_bytes()
}

/// Returns a system with connections between connectors that do not exist.
pub fn unrelated(count: usize) -> Vec<u8> {
    let connect = |number: usize| connection(("", &format!("a{number}")), ("", &format!("a{}", number + 1)));
    closed(system(&component("c", "m"), ""), &(0..count).map(connect).collect::<String>())
}

/// Returns contents of `SystemStructure.ssd`. In the directory of the system, `m` is a directory with an FMU, and `p.ssv` is a file
/// with parameters.
pub fn systems() -> Files {
    let nested = |count: usize, name: &str| {
        let begin = format!("<ssd:System name=\"{name}\"><ssd:Elements>").repeat(count);
        closed(system(&(begin + &"</ssd:Elements></ssd:System>".repeat(count)), ""), "")
    };
    let source = |source: &str| closed(system(&component("c", source), ""), "");
    let bound = |source: &str| {
        let binding = format!(
            "<ssd:ParameterBindings><ssd:ParameterBinding source=\"{source}\"/></ssd:ParameterBindings>"
        );
        closed(system(&component("c", "m"), &binding), "")
    };
    let many = "<ssd:ParameterBinding source=\"p.ssv\"/>".repeat(1000);
    let many = closed(
        system(&component("c", "m"), &format!("<ssd:ParameterBindings>{many}</ssd:ParameterBindings>")),
        "",
    );
    let twice = component("c", "m") + &component("c", "m");
    let good = component("a", "m") + &component("b", "m");
    let fed_twice = connection(("a", "y"), ("b", "u")).repeat(2);
    vec![
        ("two components", closed(system(&good, ""), &connection(("a", "y"), ("b", "u")))),
        ("nested", nested(10_000, "s")),
        ("long names", nested(200, &"n".repeat(2000))),
        ("circle", chain(500, true)),
        ("chain", chain(500, false)),
        ("unrelated connections", unrelated(4000)),
        ("absolute source", source("/etc/passwd")),
        ("source above", source("../secret.fmu")),
        ("encoded source above", source("%2e%2e%2fsecret.fmu")),
        ("source with a scheme", source("http://example.org/a.fmu")),
        ("source with a file scheme", source("file:///etc/passwd")),
        ("device", source("/dev/zero")),
        ("pipe", source("pipe")),
        ("itself", source("")),
        ("parameters above", bound("../secret.ssv")),
        ("parameters from a device", bound("/dev/zero")),
        ("parameters from a pipe", bound("pipe")),
        ("parameters from a link", bound("link")),
        ("parameters from a directory", bound("m")),
        ("parameters", bound("p.ssv")),
        ("parameters a thousand times", many),
        ("component twice", closed(system(&twice, ""), "")),
        ("input fed twice", closed(system(&good, ""), &fed_twice)),
        ("control characters", source("&#10;\u{9b}[31m\u{202e}")),
        ("no system", b"<a/>".to_vec()),
        ("empty", Vec::new()),
    ]
}

/// Returns a model description and systems in which the same text, transformation or mapping has many uses, so that reading it again
/// for each use would take minutes or gigabytes.
pub fn uses() -> [Files; 2] {
    let zeros = "0".repeat(1_000_000);
    let of_texts: String = (2..60_000)
        .map(|number| format!("<Float64 name=\"a{number}\" valueReference=\"{number}\" declaredType=\"T\"><Dimension valueReference=\"1\"/></Float64>"))
        .collect();
    let of_texts = format!(
        "<TypeDefinitions><Float64Type name=\"T\" min=\"{zeros}\"/></TypeDefinitions><ModelVariables>\
        <UInt64 name=\"n\" valueReference=\"1\" causality=\"structuralParameter\" start=\"{zeros}\"/>{of_texts}</ModelVariables>"
    );
    let parameter = "<ssd:Parameter name=\"q\"><ssd:Real value=\"1\"/></ssd:Parameter>".repeat(30_000);
    let mapping = "<ssd:MappingEntry source=\"q\" target=\"c\"/>".repeat(30_000);
    let mapped = format!(
        "<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues><ssd:ParameterSet><ssd:Parameters>{parameter}</ssd:Parameters>\
        </ssd:ParameterSet></ssd:ParameterValues><ssd:ParameterMapping>{mapping}</ssd:ParameterMapping></ssd:ParameterBinding></ssd:ParameterBindings>"
    );
    let systems = vec![
        ("mappings of each parameter", closed(system(&component("c", "m"), &mapped), "")),
        ("transformation before a fan", fan("Integer", 20_000, 5000)),
        ("names of an enumeration", fan("Enumeration", 60_000, 1)),
    ];
    [vec![("long numbers of a type and of a size", description(3, "", CS, &of_texts))], systems]
}

/// Returns parameter sets (SSV).
pub fn parameters() -> Files {
    let set = |parameters: &str| {
        format!("<ssv:ParameterSet xmlns:ssv=\"http://ssp-standard.org/SSP1/SystemStructureParameterValues\" version=\"1.0\" name=\"p\"><ssv:Parameters>{parameters}</ssv:Parameters></ssv:ParameterSet>").into_bytes()
    };
    let real = |name: &str, value: &str| {
        format!("<ssv:Parameter name=\"{name}\"><ssv:Real value=\"{value}\"/></ssv:Parameter>")
    };
    vec![
        ("one", set(&real("c.u", "1"))),
        ("many", set(&real("c.u", "1").repeat(1000))),
        ("not finite", set(&real("c.u", "nan"))),
        ("unknown", set(&real(&"\u{85}".repeat(10_000), "1"))),
        ("no value", set("<ssv:Parameter name=\"c.u\"/>")),
        ("nested", "<a>".repeat(10_000).into_bytes()),
        ("empty", Vec::new()),
    ]
}

fn packed(entries: impl IntoIterator<Item = (String, Vec<u8>)>) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in entries {
        archive.start_file(name, SimpleFileOptions::default()).unwrap();
        archive.write_all(&content).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

/// Replaces all occurrences of `from` in an archive by `to`, which has the same length. There must be at least one.
fn replaced(archive: Vec<u8>, from: &[u8], to: &[u8]) -> Vec<u8> {
    assert_eq!(from.len(), to.len());
    let mut archive = archive;
    let at: Vec<_> = archive
        .windows(from.len())
        .enumerate()
        .filter(|(_, window)| *window == from)
        .map(|(at, _)| at)
        .collect();
    assert!(!at.is_empty());
    at.into_iter().for_each(|at| archive[at..][..to.len()].copy_from_slice(to));
    archive
}

/// Returns archives that are opened as an FMU and as a system.
pub fn archives() -> Files {
    let one = |name: &str| packed([(name.to_owned(), b"x".to_vec())]);
    let link = {
        let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
        archive.add_symlink("modelDescription.xml", "/etc/passwd", SimpleFileOptions::default()).unwrap();
        archive.finish().unwrap().into_inner()
    };
    // The entry declares 2 GB, but has 70 kB.
    let bomb = packed([("modelDescription.xml".to_owned(), vec![b' '; 70_000])]);
    let bomb = replaced(bomb, &70_000_u32.to_le_bytes(), &(2_u32 << 30).to_le_bytes());
    let declared = |size: u32| [b"x\x9c".to_vec(), size.to_le_bytes().to_vec()].concat();
    // The entry declares fewer bytes than it contains.
    let liar = packed([("modelDescription.xml".to_owned(), vec![b' '; 70_000])]);
    let size = 70_000_u32.to_le_bytes();
    let liar = replaced(liar, &size, &10_u32.to_le_bytes());
    let mut counted = one("a");
    let end = counted.windows(4).rposition(|window| window == b"PK\x05\x06").unwrap();
    counted[end + 8..end + 12].copy_from_slice(&[0xff; 4]);
    vec![
        ("an FMU", packed([("modelDescription.xml".to_owned(), descriptions().remove(0).1)])),
        ("bomb", bomb),
        ("entries", packed((0..2000).map(|number| (format!("{number}/"), Vec::new())))),
        (
            "directories",
            packed((0..30).map(|number| (format!("{number}/{}x", "d/".repeat(1900)), Vec::new()))),
        ),
        ("declared size", liar),
        ("declared entries", counted),
        ("above", one("../outside")),
        ("far above", one("a/../../../../../../../../tmp/outside")),
        ("absolute", one("/tmp/outside")),
        ("windows", one("..\\outside")),
        ("drive", one("C:\\outside")),
        ("NUL in a name", replaced(one("modelDescription.xmlX"), b"xmlX", b"xml\0")),
        ("control characters", one("\u{1b}[31m\n../a")),
        ("long name", one(&"n".repeat(60_000))),
        ("file and directory", packed([("a".to_owned(), b"x".to_vec()), ("a/b".to_owned(), b"x".to_vec())])),
        ("link", link),
        ("trailing", [one("a"), declared(7)].concat()),
        ("empty", Vec::new()),
    ]
}
