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
         </ModelVariables>",
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
        let system =
            binding("", outer, "") + &elements(&format!("<ssd:System name=\"n\">{nested}</ssd:System>"));
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
    assert_eq!(of(&[("gain", REAL[1])], &[("b.gain", REAL[2])]), [5.0, 1.0]);
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
    ] {
        let system = elements(&component("a", &bound(attributes)));
        let stone = set("<ssv:Real value=\"3\" unit=\"stone\"/>");
        let directory =
            written(&system, "", &[("p.ssv", &of_system), ("m/p.ssv", &of_component), ("stone.ssv", &stone)]);
        match (opened(directory.path(), Order::Dependencies), expected) {
            (Ok(system), Ok(expected)) => assert_eq!(values(&system, &["a.u"]), [expected]),
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
        ("a.y", "zz.u", "", "S has no variable \"zz.u\""),
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
            "factor of a LinearTransformation is \"x\", not a number",
        ),
        ("a.y", "b.u", "<ssc:OtherTransformation/>", "has the transformation OtherTransformation"),
        ("speed", "b.u", "", "speed cannot feed b.u: the output is in m/s, the input in deg"),
        ("n.out", "n.in", "", "form a circle"),
    ] {
        let nested = connectors(&[("in", "input", ""), ("out", "output", "")])
            + &connections(&[connection("in", "out", "")]);
        let outer = connectors(&[("in", "input", ""), ("speed", "input", "m/s")])
            + &elements(
                &(component("a", "")
                    + &component("b", "")
                    + &format!("<ssd:System name=\"n\">{nested}</ssd:System>")),
            )
            + &connections(&[connection(start, end, content)]);
        let directory = written(&outer, "", &[]);
        let found = opened(directory.path(), Order::Dependencies).unwrap_err().to_string();
        assert!(found.contains(why), "{start} to {end}: {found}");
    }
    let twice = [connection("a.y", "b.u", ""), connection("b.u", "b.y", "")];
    let directory =
        written(&(elements(&(component("a", "") + &component("b", ""))) + &connections(&twice)), "", &[]);
    let found = opened(directory.path(), Order::Jacobi).unwrap_err().to_string();
    assert!(found.contains("b.u is fed twice"), "{found}");
}
