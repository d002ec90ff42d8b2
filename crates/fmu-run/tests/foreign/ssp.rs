//! Systems as the SSP standard allows them: directions, units, transformations, start values and their mappings.

use crate::built::built;
use fmu_run::{Batch, Error, Order, Setup, Standard, System, Trajectory, Watch};
use std::path::Path;
use tempfile::TempDir;

/// Adds units and a Boolean to the model description: u and out are in degrees, y is in rad.
const CHANGES: [(&str, &str); 4] = [
    (
        "<DefaultExperiment",
        "<UnitDefinitions><Unit name=\"deg\"><BaseUnit rad=\"1\" factor=\"0.5\"/></Unit><Unit name=\"rad\"><BaseUnit rad=\"1\"/>\
         <DisplayUnit name=\"turn\" factor=\"0.25\"/></Unit></UnitDefinitions><DefaultExperiment",
    ),
    (
        "<ScalarVariable name=\"u\" valueReference=\"1\" causality=\"input\" variability=\"continuous\"><Real start=\"0\"/>",
        "<ScalarVariable name=\"u\" valueReference=\"1\" causality=\"input\" variability=\"continuous\"><Real start=\"0\" unit=\"deg\"/>",
    ),
    (
        "<Real/></ScalarVariable>\n    <ScalarVariable name=\"gain\"",
        "<Real unit=\"rad\"/></ScalarVariable>\n    <ScalarVariable name=\"gain\"",
    ),
    (
        "</ModelVariables>",
        "<ScalarVariable name=\"on\" valueReference=\"25\" causality=\"parameter\" variability=\"tunable\"><Boolean start=\"false\"/></ScalarVariable>\
         <ScalarVariable name=\"b.u\" valueReference=\"1\" causality=\"input\" variability=\"continuous\"><Real start=\"0\" unit=\"deg\"/>\
         </ScalarVariable></ModelVariables>",
    ),
];

/// Writes a system with the content of its outer system, of the parts after it, and of further files. In its directory, `m.fmu` is an
/// FMU, and `m` is the same FMU, unpacked.
fn written(outer: &str, rest: &str, files: &[(&str, &str)]) -> TempDir {
    let directory = tempfile::tempdir().unwrap();
    let archive = built("plain", Standard::Fmi2, directory.path(), &CHANGES);
    let file = std::fs::File::open(&archive).unwrap();
    zip::ZipArchive::new(file).unwrap().extract(directory.path().join("m")).unwrap();
    std::fs::rename(archive, directory.path().join("m.fmu")).unwrap();
    let text = format!(
        "<ssd:SystemStructureDescription xmlns:ssd=\"http://ssp-standard.org/SSP1/SystemStructureDescription\" \
         xmlns:ssc=\"http://ssp-standard.org/SSP1/SystemStructureCommon\" xmlns:ssv=\"http://ssp-standard.org/SSP1/SystemStructureParameterValues\" \
         xmlns:ssm=\"http://ssp-standard.org/SSP1/SystemStructureParameterMapping\" version=\"1.0\" name=\"S\">\
         <ssd:System name=\"s\">{outer}</ssd:System>{rest}</ssd:SystemStructureDescription>"
    );
    for (name, content) in [("SystemStructure.ssd", &*text)].iter().chain(files) {
        std::fs::write(directory.path().join(name), content).unwrap();
    }
    directory
}

fn opened(directory: &Path, order: Order) -> Result<System, Error> {
    // SAFETY: the FMU of these tests.
    unsafe { System::open(directory, order) }
}

fn component(name: &str, content: &str) -> String {
    format!("<ssd:Component name=\"{name}\" source=\"m\">{content}</ssd:Component>")
}

/// Returns a connection between two connectors, `element.connector` or `connector`.
fn connection(start: &str, end: &str, content: &str) -> String {
    let side = |side: &str, name: &str| match name.rsplit_once('.') {
        Some((element, name)) => format!("{side}Element=\"{element}\" {side}Connector=\"{name}\""),
        None => format!("{side}Connector=\"{name}\""),
    };
    let suppress = if content.contains("ssc:") && content.starts_with('!') {
        "suppressUnitConversion=\"true\""
    } else {
        ""
    };
    let content = content.trim_start_matches('!');
    format!(
        "<ssd:Connection {} {} {suppress}>{content}</ssd:Connection>",
        side("start", start),
        side("end", end)
    )
}

fn connectors(all: &[(&str, &str, &str)]) -> String {
    let one = |(name, kind, unit): &(&str, &str, &str)| {
        let unit = if unit.is_empty() { String::new() } else { format!("unit=\"{unit}\"") };
        format!("<ssd:Connector name=\"{name}\" kind=\"{kind}\"><ssc:Real {unit}/></ssd:Connector>")
    };
    format!("<ssd:Connectors>{}</ssd:Connectors>", all.iter().map(one).collect::<String>())
}

/// Returns a parameter binding with values, each as an element such as `Real value="1"`.
fn binding(attributes: &str, values: &[(&str, &str)], mapping: &str) -> String {
    let parameter = |(name, value): &(&str, &str)| {
        format!("<ssv:Parameter name=\"{name}\"><ssv:{value}/></ssv:Parameter>")
    };
    let values: String = values.iter().map(parameter).collect();
    format!(
        "<ssd:ParameterBindings><ssd:ParameterBinding {attributes}><ssd:ParameterValues><ssv:ParameterSet version=\"1.0\" name=\"p\">\
         <ssv:Parameters>{values}</ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues>{mapping}</ssd:ParameterBinding></ssd:ParameterBindings>"
    )
}

fn elements(all: &str) -> String {
    format!("<ssd:Elements>{all}</ssd:Elements>")
}

fn connections(all: &[String]) -> String {
    format!("<ssd:Connections>{}</ssd:Connections>", all.concat())
}

/// Returns the values of variables after the initialization.
fn values(system: &System, names: &[&str]) -> Vec<f64> {
    let mut one = system.instances(&Setup::default()).unwrap();
    let mut values = vec![0.0; names.len()];
    one.get(&system.select(names).unwrap(), &mut values);
    assert_eq!(one.errors().next(), None);
    values
}

const REAL: [&str; 3] = ["Real value=\"5\"", "Real value=\"6\"", "Real value=\"7\""];

/// Of several values for a parameter, the outermost system's counts, and within a system the last one (section 5.2.3 of SSP 1.0).
#[test]
fn outer_values_take_precedence() {
    let own =
        binding("", &[("gain", REAL[0]), ("on", "Boolean value=\"1\""), ("label", "String value=\"x\"")], "");
    let of = |inner: &[(&str, &str)], outer: &[(&str, &str)]| {
        let nested = binding("", inner, "") + &elements(&component("a", &own));
        // Each value has its own binding.
        let outer: String = outer.iter().map(|one| binding("", &[*one], "")).collect();
        let outer = outer.replace("</ssd:ParameterBindings><ssd:ParameterBindings>", "");
        let system = outer + &elements(&format!("<ssd:System name=\"n\">{nested}</ssd:System>"));
        let directory = written(&system, "", &[]);
        values(&opened(directory.path(), Order::Dependencies).unwrap(), &["n.a.gain", "n.a.on"])
    };
    assert_eq!(of(&[], &[]), [5.0, 1.0]);
    assert_eq!(of(&[("a.gain", REAL[1])], &[]), [6.0, 1.0]);
    assert_eq!(
        of(&[("a.gain", REAL[1])], &[("n.a.gain", REAL[2]), ("n.a.on", "Boolean value=\"0\"")]),
        [7.0, 0.0]
    );
    assert_eq!(of(&[], &[("n.a.gain", REAL[2]), ("n.a.gain", REAL[1])]), [6.0, 1.0]);
    // A parameter set may contain parameters of other systems.
    let unused = [("gain", REAL[1]), ("b.gain", REAL[2])];
    assert_eq!(of(&unused[..1], &unused[1..]), [5.0, 1.0]);
    let system = binding(
        "",
        &unused,
        "<ssd:ParameterMapping><ssm:MappingEntry source=\"K\" target=\"a.gain\"/></ssd:ParameterMapping>",
    );
    let warnings = |system: &str| {
        let directory = written(&(system.to_owned() + &elements(&component("a", ""))), "", &[]);
        opened(directory.path(), Order::Dependencies).unwrap().warnings().to_vec()
    };
    assert_eq!(warnings(&system), ["a mapping of the system has \"K\", which is no parameter"]);
    let unknown = |name: &str| format!("the value of {name} is not used, because there is no such variable");
    assert_eq!(warnings(&binding("", &unused, "")), ["gain", "b.gain"].map(unknown));
}

#[test]
fn parameters_are_mapped() {
    let entry = |source: &str, target: &str, rest: &str| {
        format!("<ssm:MappingEntry source=\"{source}\" target=\"{target}\">{rest}</ssm:MappingEntry>")
    };
    let entries = [
        entry("K", "a.gain", ""),
        entry("K", "b.gain", "<ssc:LinearTransformation factor=\"10\" offset=\"1\"/>"),
        entry(
            "flag",
            "a.on",
            "<ssc:BooleanMappingTransformation><ssc:MapEntry source=\"false\" target=\"true\"/></ssc:BooleanMappingTransformation>",
        ),
        entry(
            "level",
            "a.valve",
            "<ssc:IntegerMappingTransformation><ssc:MapEntry source=\"3\" target=\"30\"/></ssc:IntegerMappingTransformation>",
        ),
    ];
    let mapping = format!(
        "<ssm:ParameterMapping version=\"1.0\" xmlns:ssm=\"m\" xmlns:ssc=\"c\">{}</ssm:ParameterMapping>",
        entries.concat()
    );
    let given = [
        ("K", REAL[0]),
        ("flag", "Boolean value=\"false\""),
        ("level", "Integer value=\"3\""),
        ("b.gain", REAL[2]),
    ];
    for inline in [true, false] {
        let (of, files) = match inline {
            true => (format!("<ssd:ParameterMapping>{mapping}</ssd:ParameterMapping>"), vec![]),
            false => ("<ssd:ParameterMapping source=\"map.ssm\"/>".to_owned(), vec![("map.ssm", &*mapping)]),
        };
        let system = binding("", &given, &of) + &elements(&(component("a", "") + &component("b", "")));
        let directory = written(&system, "", &files);
        let system = opened(directory.path(), Order::Dependencies).unwrap();
        assert_eq!(values(&system, &["a.gain", "b.gain", "a.on", "a.valve"]), [5.0, 51.0, 1.0, 30.0]);
    }
}

#[test]
fn start_values_have_units_and_sources_in_components() {
    let set = |value: &str| {
        format!(
            "<ssv:ParameterSet xmlns:ssv=\"v\" xmlns:ssc=\"c\" version=\"1.0\" name=\"p\"><ssv:Parameters><ssv:Parameter name=\"u\">{value}</ssv:Parameter>\
             </ssv:Parameters><ssv:Units><ssc:Unit name=\"half\"><ssc:BaseUnit rad=\"1\" factor=\"1\"/></ssc:Unit></ssv:Units></ssv:ParameterSet>"
        )
    };
    let bound = |attributes: &str| {
        format!("<ssd:ParameterBindings><ssd:ParameterBinding {attributes}/></ssd:ParameterBindings>")
    };
    let (of_system, of_component) =
        (set("<ssv:Real value=\"3\" unit=\"half\"/>"), set("<ssv:Real value=\"4\" unit=\"deg\"/>"));
    for (attributes, expected) in [
        ("source=\"p.ssv\"", Ok(6.0)),
        ("source=\"p.ssv\" sourceBase=\"SSD\"", Ok(6.0)),
        ("source=\"p.ssv\" sourceBase=\"component\"", Ok(4.0)),
        ("source=\"../p.ssv\" sourceBase=\"component\"", Err("is outside of the archive")),
        ("source=\"stone.ssv\"", Err("u can be given in deg, not in \"stone\"")),
        ("source=\"empty.ssv\"", Ok(3.0)),
        (
            "source=\"p.csv\" type=\"text/csv\"",
            Err("a has a ParameterBinding of the type text/csv, which cannot be read"),
        ),
        ("source=\"missing.ssv\"", Err("there is no readable missing.ssv in it")),
    ] {
        let system = elements(&component("a", &bound(attributes)));
        let stone = set("<ssv:Real value=\"3\" unit=\"stone\"/>").replace(
            "<ssv:Units>",
            "<ssv:Units><ssc:Unit name=\"stone\"><ssc:BaseUnit kg=\"1\" factor=\"6.35\"/></ssc:Unit>",
        );
        let empty = set("<ssv:Real value=\"3\" unit=\"\"/>");
        let files = [
            ("p.ssv", &*of_system),
            ("m/p.ssv", &of_component),
            ("stone.ssv", &stone),
            ("empty.ssv", &empty),
        ];
        let directory = written(&system, "", &files);
        match (opened(directory.path(), Order::Dependencies), expected) {
            (Ok(system), Ok(expected)) => {
                assert_eq!((values(&system, &["a.u"]), system.warnings()), (vec![expected], &[][..]));
                // The start value that is shown is the one that is in force.
                let variables = system.variables();
                let shown = variables.iter().find(|(name, _)| name == "a.u").unwrap().1.start.clone();
                assert_eq!(shown.as_deref(), Some(&*expected.to_string()));
            }
            (found, expected) => {
                let (found, expected) = (found.unwrap_err().to_string(), expected.unwrap_err());
                assert!(found.contains(expected), "{found}");
            }
        }
    }
}

/// `start` and `end` of a connection do not state its direction, and units are converted before a transformation (sections 4.5.2 and 5.3.2
/// of SSP 1.0). One of the units "deg" of this test is half a rad.
#[test]
fn connections_have_directions_units_and_transformations() {
    let linear = |factor: &str, offset: &str| {
        format!("<ssc:LinearTransformation factor=\"{factor}\" offset=\"{offset}\"/>")
    };
    let replaced = "<ssc:IntegerMappingTransformation><ssc:MapEntry source=\"0\" target=\"70\"/></ssc:IntegerMappingTransformation>";
    let outer = connectors(&[
        ("in", "input", ""),
        ("half", "input", "half"),
        ("out", "output", ""),
        ("copy", "output", ""),
        ("halved", "output", "half"),
        ("alone", "input", ""),
        ("echo", "output", ""),
    ]);
    let inner = connectors(&[("x", "input", ""), ("z", "output", "")])
        + &elements(&component("c", &binding("", &[("gain", REAL[0])], "")))
        + &connections(&[connection("c.u", "x", ""), connection("z", "c.y", "")]);
    let parts = component("a", &binding("", &[("gain", REAL[1])], ""))
        + &component("b", "")
        + &component("d", "")
        + &component("e", "")
        + &format!("<ssd:System name=\"n\">{inner}</ssd:System>");
    let all = connections(&[
        connection("b.u", "a.y", &linear("10", "1")),
        connection("d.u", "n.z", ""),
        connection("in", "n.x", &linear("2", "0")),
        connection("a.u", "half", ""),
        connection("out", "n.z", &linear("1", "100")),
        connection("halved", "a.y", ""),
        connection("in", "copy", &linear("1", "-1")),
        connection("echo", "alone", ""),
        connection("a.counter", "b.valve", replaced),
        connection("a.y", "e.u", &("!".to_owned() + &linear("3", "0"))),
    ]);
    let units =
        "<ssd:Units><ssc:Unit name=\"half\"><ssc:BaseUnit rad=\"1\" factor=\"2\"/></ssc:Unit></ssd:Units>";
    let directory = written(&(outer + &elements(&parts) + &all), units, &[]);
    for order in [Order::Dependencies, Order::Jacobi] {
        let system = opened(directory.path(), order).unwrap();
        let names = ["b.u", "d.u", "out", "halved", "b.valve", "e.u"];
        // a.y = 6 rad = 12 deg = 3 half; n.z = c.y = 5 rad = 10 deg; n.z is not converted, because z has no unit.
        assert_eq!(values(&system, &names), [121.0, 10.0, 105.0, 3.0, 70.0, 18.0], "{order:?}");
        let mut one = system.instances(&Setup::default()).unwrap();
        let inputs = system.select(&["in", "half"]).unwrap();
        one.set(&inputs, &[3.0, 1.0], None).unwrap();
        let mut found = [0.0; 5];
        one.get(&system.select(&["n.c.u", "a.u", "in", "half", "copy"]).unwrap(), &mut found);
        assert_eq!(found, [6.0, 4.0, 3.0, 1.0, 2.0]);
        let batch = Batch {
            time: &[0.0, 1.0],
            inputs: vec![("in", Trajectory::Constant(0.5)), ("half", Trajectory::Shared(&[0.25, 0.5]))],
            outputs: vec!["out", "copy", "halved", "a.u"],
            every: Some(1),
            ..Batch::default()
        };
        let runs = system.run(&batch, &Watch::default()).unwrap();
        assert_eq!(runs.errors, []);
        assert_eq!(runs.trajectories, [105.0, 106.0, -0.5, -0.5, 3.0, 3.5, 1.0, 2.0]);
        let variables = system.variables();
        let variables: Vec<_> =
            variables.iter().filter(|(name, _)| name == "halved" || name == "out").collect();
        let unit = |index: usize| variables[index].1.unit.as_deref();
        assert_eq!([unit(0), unit(1)], [Some("half"), Some("rad")]);
        for (name, why) in [
            ("copy", "copy is an output of the system, it cannot be set"),
            ("alone", "alone is a connector that no connection leads to a variable"),
            ("echo", "echo is a connector that no connection leads to a variable"),
        ] {
            let inputs = vec![(name, Trajectory::Constant(1.0))];
            let found =
                system.run(&Batch { time: &[0.0, 1.0], inputs, ..Batch::default() }, &Watch::default());
            let found = found.unwrap_err().to_string();
            assert!(found.starts_with(why), "{found}");
        }
    }
}

#[test]
fn wrong_connections_are_errors() {
    for (start, end, content, why) in [
        ("a.nope", "b.u", "", "S has no variable \"a.nope\""),
        ("a.y", "zz.u", "", "a connection leads to zz.u, but there is no element zz"),
        ("a.y", "b.nope", "", "S has no variable \"b.nope\""),
        ("nope", "b.u", "", "S has no variable \"nope\""),
        ("a.y", "b.y", "", "has no direction: one is output, the other output"),
        ("a.u", "b.u", "", "has no direction: one is input, the other input"),
        ("in", "in", "", "has no direction"),
        ("a.y", "b.valve", "", "a.y cannot feed b.valve: the output is Real, the input Integer"),
        (
            "a.counter",
            "b.valve",
            "<ssc:LinearTransformation factor=\"2\"/>",
            "linear transformations are only for Real",
        ),
        (
            "a.y",
            "b.u",
            "<ssc:LinearTransformation factor=\"x\"/>",
            "factor of LinearTransformation is \"x\", not a number",
        ),
        ("a.y", "b.u", "<ssc:OtherTransformation/>", "has the transformation OtherTransformation"),
        ("speed", "b.u", "", "speed cannot feed b.u: the output is in m/s, the input in deg"),
        (
            "b.y",
            "a.ghost",
            "",
            "a.ghost is a connector, but not a variable of the FMU: S has no variable \"a.ghost\"",
        ),
        (
            "out",
            "out",
            "",
            "the connection between out and out has no direction: one is local, the other local",
        ),
        ("n.out", "n.in", "", "form a circle"),
    ] {
        let nested = connectors(&[("in", "input", ""), ("out", "output", "")])
            + &connections(&[connection("in", "out", "")]);
        let outer = connectors(&[("in", "input", ""), ("speed", "input", "m/s"), ("out", "local", "")])
            + &elements(
                &(component("a", &connectors(&[("ghost", "input", "")]))
                    + &component("b", "")
                    + &format!("<ssd:System name=\"n\">{nested}</ssd:System>")),
            )
            + &connections(&[connection(start, end, content)]);
        let speed =
            "<ssd:Units><ssc:Unit name=\"m/s\"><ssc:BaseUnit m=\"1\" s=\"-1\"/></ssc:Unit></ssd:Units>";
        let directory = written(&outer, speed, &[]);
        let found = opened(directory.path(), Order::Dependencies).unwrap_err().to_string();
        assert!(found.contains(why), "{start} to {end}: {found}");
    }
    let twice = [connection("a.y", "b.u", ""), connection("b.u", "b.y", "")];
    let directory =
        written(&(elements(&(component("a", "") + &component("b", ""))) + &connections(&twice)), "", &[]);
    let found = opened(directory.path(), Order::Jacobi).unwrap_err().to_string();
    assert!(found.contains("b.u is fed twice"), "{found}");
}

/// Names of components and of variables may contain dots, so `a.b.u` may be the variable `b.u` of component `a` or the variable `u` of
/// component `a.b`. A connection has both parts, so it leads to the right one. A name without them is an error.
#[test]
fn names_with_dots_are_not_confused() {
    let source = component("s", &binding("", &[("gain", REAL[1])], ""));
    let all = source + &component("a", "") + &component("a.b", "");
    let connected = |end: &str| {
        let (element, connector) = end.split_once('/').unwrap();
        format!(
            "<ssd:Connections><ssd:Connection startElement=\"s\" startConnector=\"y\" endElement=\"{element}\" \
             endConnector=\"{connector}\"/></ssd:Connections>"
        )
    };
    // s.y is 6 rad, 12 deg; an integrator with the input 12 has the output 12 after a second.
    for (end, expected) in [("a.b/u", [0.0, 12.0]), ("a/b.u", [12.0, 0.0])] {
        let directory = written(&(elements(&all) + &connected(end)), "", &[]);
        let system = opened(directory.path(), Order::Dependencies).unwrap();
        let mut one = system.instances(&Setup::default()).unwrap();
        one.step(1.0, None).unwrap();
        let mut found = [0.0; 2];
        one.get(&system.select(&["a.y", "a.b.y"]).unwrap(), &mut found);
        assert_eq!(found, expected, "{end}");
        let why = system.select(&["a.b.u"]).unwrap_err().to_string();
        let parts = "the variable b.u of component a and the variable u of component a.b";
        assert_eq!(why, format!("a.b.u is ambiguous: it is {parts}; rename one of them"));
    }
    let bound = binding("", &[("a.b.u", REAL[0])], "") + &elements(&all);
    let found = opened(written(&bound, "", &[]).path(), Order::Jacobi).unwrap_err().to_string();
    assert!(found.contains("the parameter a.b.u is ambiguous"), "{found}");
    let twice = elements(
        &(component("n.c", "")
            + &format!("<ssd:System name=\"n\">{}</ssd:System>", elements(&component("c", "")))),
    );
    let found = opened(written(&twice, "", &[]).path(), Order::Jacobi).unwrap_err().to_string();
    assert!(found.contains("two elements are named n.c"), "{found}");
}

/// A value whose unit is not defined is taken as it is given, with a warning.
#[test]
fn undefined_units_are_warnings() {
    let ends = connectors(&[("way", "input", "[m]")]);
    let bound =
        binding("", &[("u", "Real value=\"3\" unit=\"[m]\""), ("gain", "Real value=\"5\" unit=\"[m]\"")], "");
    let system = ends
        + &elements(&(component("a", &bound) + &component("b", "")))
        + &connections(&[connection("way", "b.u", "")]);
    let directory = written(&system, "", &[]);
    let system = opened(directory.path(), Order::Dependencies).unwrap();
    assert_eq!(
        system.warnings(),
        [
            "the unit \"[m]\" is not defined, so values pass unconverted from way, in \"[m]\", to b.u, in \"deg\"",
            "the value of a.u is in \"[m]\" and the variable in \"deg\", one of which is not defined, so the value is not converted",
        ]
    );
    let mut one = system.instances(&Setup::default()).unwrap();
    one.set(&system.select(&["way"]).unwrap(), &[7.0], None).unwrap();
    let mut found = [0.0; 3];
    one.get(&system.select(&["a.u", "b.u", "a.gain"]).unwrap(), &mut found);
    // The gain has no unit, so its value is not converted (section 5.2.3 of SSP 1.0).
    assert_eq!(found, [3.0, 7.0, 5.0]);
}

/// The start values of the system are those that variables show, also converted to the unit of a connector.
#[test]
fn start_values_in_force_are_shown() {
    let ends = connectors(&[("half", "input", "half")]);
    let bound = binding(
        "",
        &[
            ("on", "Boolean value=\"1\""),
            ("valve", "Integer value=\"30\""),
            ("label", "String value=\"x\""),
            ("u", "Real value=\"4\""),
        ],
        "",
    );
    let system = ends
        + &elements(&(component("a", &bound) + &component("b", "")))
        + &connections(&[connection("half", "a.u", "")]);
    let units =
        "<ssd:Units><ssc:Unit name=\"half\"><ssc:BaseUnit rad=\"1\" factor=\"2\"/></ssc:Unit></ssd:Units>";
    let directory = written(&system, units, &[]);
    let variables = opened(directory.path(), Order::Dependencies).unwrap().variables();
    let starts: std::collections::HashMap<_, _> =
        variables.iter().map(|(name, of)| (name, of.start.as_deref())).collect();
    let of = |name: &str| starts[name];
    assert_eq!(["a.on", "a.valve", "a.label"].map(of), [Some("true"), Some("30"), Some("x")]);
    // 4 deg are 2 rad, 1 half; b.u is another name of the same input.
    assert_eq!(["a.u", "a.b.u", "half"].map(of), [Some("4"), Some("4"), Some("1")]);
    assert_eq!(
        ["b.on", "b.valve", "b.label", "b.u"].map(of),
        [Some("false"), Some("1"), Some("none"), Some("0")]
    );
}

#[test]
fn wrong_structures_are_errors() {
    let of = |outer: &str, files: &[(&str, &str)]| {
        opened(written(outer, "", files).path(), Order::Jacobi).unwrap_err().to_string()
    };
    let source = |source: &str| component("a", "").replace("source=\"m\"", source);
    for (system, why) in [
        (source("source=\"other.fmu\""), "component a: there is no readable other.fmu in it"),
        (
            source("type=\"application/x-ssp-definition\" source=\"m\""),
            "component a is not an FMU but application/x-ssp-definition, which cannot be run",
        ),
        (component("a", "").replace("name=\"a\"", ""), "a Component lacks name"),
        (
            source("source=\"m\" implementation=\"ModelExchange\""),
            "component a asks for ModelExchange (implementation), and systems run Co-Simulation only",
        ),
        (
            component("a", &connectors(&[("u", "Input", "")])),
            "the connector a.u is of the unknown kind Input",
        ),
    ] {
        let found = of(&elements(&system), &[]);
        assert!(found.contains(why), "{found}");
    }
    for (value, why) in [
        (
            "Real value=\"60\" units=\"deg\"",
            "gain: a Real has the unknown attribute units; there are value, unit",
        ),
        ("Integer value=\"1.5\"", "the value of a.gain is \"1.5\", not an integer"),
        ("Float value=\"1\"", "gain is a Float; there are Real, Integer"),
        ("Real value=\"1\"/><ssv:Real value=\"2\"", "gain has several values"),
        (
            "Real value=\"1\"/></ssv:Parameter><ssv:Parameter name=\"gain\"><ssv:Real value=\"2\"",
            "a parameter set has gain twice",
        ),
    ] {
        let found = of(&elements(&component("a", &binding("", &[("gain", value)], ""))), &[]);
        assert!(found.contains(why), "{found}");
    }
    for (content, why) in [
        (
            "<ssc:Lineartransformation factor=\"2\"/>",
            "has the transformation Lineartransformation, which is unknown",
        ),
        (
            "<ssc:LinearTransformation factr=\"2\"/>",
            "a LinearTransformation has the unknown attribute factr; there are factor",
        ),
    ] {
        let system = elements(&(component("a", "") + &component("b", "")))
            + &connections(&[connection("a.y", "b.u", content)]);
        let found = of(&system, &[]);
        assert!(found.contains(why), "{found}");
    }
    let found = of("", &[("SystemStructure.ssd", "<a")]);
    assert!(found.contains("SystemStructure.ssd is not well-formed XML"), "{found}");
}

#[test]
fn wrong_mappings_and_annotations() {
    let missing = "<ssd:ParameterMapping source=\"missing.ssm\"/>";
    for (mapping, why) in [
        (missing, "there is no readable missing.ssm in it"),
        (
            "<ssd:ParameterMapping source=\"\"/>",
            "a parameter mapping of the system has neither a source nor entries",
        ),
        (
            "<ssd:ParameterMapping source=\"p.csv\" type=\"text/csv\"/>",
            "the system has a ParameterMapping of the type text/csv",
        ),
    ] {
        let system = binding("", &[("a.gain", REAL[0])], mapping) + &elements(&component("a", ""));
        let found = opened(written(&system, "", &[]).path(), Order::Jacobi).unwrap_err().to_string();
        assert!(found.contains(why), "{found}");
    }
    // Nothing is read from annotations, so a prefix in them need not be declared.
    let annotation = "<ssd:Annotations><ssc:Annotation type=\"osp\"><osp:Simulation osp:x=\"1\"><other:y/></osp:Simulation></ssc:Annotation></ssd:Annotations>";
    let system = elements(&component("a", "")) + annotation;
    let directory = written(&system, "", &[]);
    opened(directory.path(), Order::Jacobi).unwrap();
    let file = directory.path().join("SystemStructure.ssd");
    let text = std::fs::read_to_string(&file).unwrap().replace("version=\"1.0\"", "version=\"2.0\"");
    std::fs::write(&file, text).unwrap();
    let system = opened(directory.path(), Order::Jacobi).unwrap();
    assert_eq!(system.warnings(), ["SystemStructure.ssd is of version 2.0 and is read as SSP 1.0"]);
}

#[test]
fn what_ssp_does_not_define_is_a_warning() {
    let system = elements(&(component("a", &connectors(&[("y", "output", "")])) + &component("b", "")))
        + &connections(&[connection("a.y", "b.u", "")])
        + &binding("", &[("a.gain", REAL[1])], "");
    for (written_as, instead, warning) in [
        (
            "Connections>",
            "Conections>",
            "the element Conections of a System is not used; known: Connectors, ",
        ),
        (
            " startConnector",
            " starElement=\"a\" startConnector",
            "the attribute starElement of a Connection is not used; known: startElement,",
        ),
        (
            "<ssd:ParameterBinding ",
            "<ssd:ParameterBinding prefx=\"b.\" ",
            "the attribute prefx of a ParameterBinding is not used; known: type, source, sourceBase, prefix",
        ),
        (
            "<ssv:Parameter ",
            "<ssv:Parameter unit=\"m\" ",
            "the attribute unit of a Parameter is not used; known: name",
        ),
    ] {
        let changed = system.replace(written_as, instead);
        assert_ne!(changed, system, "{written_as}");
        let found = opened(written(&changed, "", &[]).path(), Order::Jacobi).unwrap().warnings().to_vec();
        assert!(matches!(&found[..], [one] if one.contains(warning)), "{written_as}: {found:?}");
    }
    let indexed = system.replace(" startConnector", " startIndices=\"1\" startConnector");
    let found = opened(written(&indexed, "", &[]).path(), Order::Jacobi).unwrap_err().to_string();
    assert!(
        found.contains("a connection has startIndices, and elements of arrays cannot be connected"),
        "{found}"
    );
}

/// libcosim takes the output from the causalities, so the two variables of a connection have any order.
#[test]
fn systems_for_libcosim_are_opened() {
    let variable =
        |simulator: &str, name: &str| format!("<Variable simulator=\"{simulator}\" name=\"{name}\"/>");
    let text = |ends: &str, rest: &str| {
        format!(
            "<OspSystemStructure xmlns=\"http://opensimulationplatform.com/MSMI/OSPSystemStructure\" version=\"0.1\">\
             <StartTime>0.0</StartTime><EndTime> 2.5 </EndTime><Simulators><Simulator name=\"a\" source=\"m\"><InitialValues>\
             <InitialValue variable=\"gain\"><Real value=\"6\"/></InitialValue><InitialValue variable=\"on\"><Boolean value=\"1\"/></InitialValue>\
             <InitialValue variable=\"label\"><String value=\"x\"/></InitialValue></InitialValues></Simulator><Simulator name=\"b\" source=\"m\"/>\
             </Simulators><Connections><VariableConnection>{ends}</VariableConnection>{rest}</Connections></OspSystemStructure>"
        )
    };
    let directory = written("", "", &[]);
    std::fs::remove_file(directory.path().join("SystemStructure.ssd")).unwrap();
    let file = directory.path().join("OspSystemStructure.xml");
    let open = |text: String, path: &Path| {
        std::fs::write(&file, text).unwrap();
        opened(path, Order::Jacobi)
    };
    let ends = variable("b", "valve") + &variable("a", "counter");
    for path in [directory.path(), &file] {
        let system = open(text(&ends, ""), path).unwrap();
        assert_eq!(system.stop_time(), Some(2.5));
        assert_eq!(system.stages(), [[("a.counter", "b.valve")]]);
        // The counter is 0, and the valve without a connection would be 1.
        assert_eq!(values(&system, &["a.gain", "a.on", "b.gain", "b.valve"]), [6.0, 1.0, 0.0, 0.0]);
    }
    let stepped = text(&ends, "").replace(" source", " stepSize=\"1e-3\" source");
    let warning = "the attribute stepSize of a Simulator is not used; known: name, source";
    assert_eq!(open(stepped, &file).unwrap().warnings(), [warning]);
    let units = variable("a", "y") + &variable("b", "u");
    for (text, why) in [
        (text(&units, ""), "a.y cannot feed b.u: the output is in rad, the input in deg"),
        (text(&variable("a", "y"), ""), "a VariableConnection has 1 variables, not 2"),
        (
            text(&(variable("a", "y") + &variable("c", "u")), ""),
            "a connection leads to c, which is no simulator",
        ),
        (text(&(variable("a", "nope") + &variable("b", "u")), ""), "has no variable \"a.nope\""),
        (text(&ends, "<SignalConnection/>"), "it has a SignalConnection, which cannot be run"),
        (text(&ends, "").replace("value=\"6\"", "value=\"six\""), "value of Real is \"six\", not a number"),
        (text(&ends, "").replace(" 2.5 ", "late"), "EndTime is \"late\", not a number"),
        (text(&ends, "").replace("variable=\"gain\"", "variable=\"y\""), "a.y is read-only"),
    ] {
        let found = open(text, directory.path()).unwrap_err().to_string();
        assert!(found.contains(why), "{found}");
    }
}
