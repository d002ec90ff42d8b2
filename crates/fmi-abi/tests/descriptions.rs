//! Model descriptions that are unusual or wrong: what is read, and what is reported.
#![cfg(feature = "description")]

use fmi_abi::description::{Fault, Item, ModelDescription};
use fmi_abi::{BaseUnit, Causality, DisplayUnit, Unit};

fn fmi2(offer: &str, variables: &str, rest: &str) -> ModelDescription {
    let text = format!(
        "<fmiModelDescription fmiVersion='2.0' modelName='m' guid='g'>\n<CoSimulation modelIdentifier='m' {offer}/>\n{rest}\n\
         <ModelVariables>{variables}</ModelVariables></fmiModelDescription>"
    );
    ModelDescription::parse(&text).unwrap()
}

fn fmi3(variables: &str, rest: &str) -> ModelDescription {
    let text = format!(
        "<fmiModelDescription fmiVersion='3.0' modelName='m' instantiationToken='g'><CoSimulation modelIdentifier='m'/>\n\
         <ModelVariables>{variables}</ModelVariables>{rest}</fmiModelDescription>"
    );
    ModelDescription::parse(&text).unwrap()
}

fn variable(name: &str, number: &str, causality: &str, of_type: &str) -> String {
    format!(
        "<ScalarVariable name='{name}' valueReference='{number}' causality='{causality}'>{of_type}</ScalarVariable>\n"
    )
}

/// The schemas define numbers and Booleans with data types for which blanks at the ends do not count (`whiteSpace` is `collapse`).
#[test]
fn blanks_around_numbers_and_booleans_do_not_count() {
    let units = "<UnitDefinitions><Unit name='rad'><BaseUnit rad=' 1 '/><DisplayUnit name='deg' factor=' 57.5 ' offset=' 2 '/></Unit></UnitDefinitions>\
        <TypeDefinitions><SimpleType name='T'><Real min=' -1 ' relativeQuantity=' true '/></SimpleType>\
        <SimpleType name='E'><Enumeration><Item name='i' value=' 3 '/></Enumeration></SimpleType></TypeDefinitions>\
        <DefaultExperiment stopTime=' 2 '/>";
    let of_type = "<Real declaredType='T' max=' 9 ' nominal=' 4 ' start=' 7 '/>";
    let found = fmi2("canGetAndSetFMUstate=' true '", &variable("x", " 1 ", "parameter", of_type), units);
    assert_eq!(found.faults, []);
    let (offer, x) = (found.co_simulation.as_ref().unwrap(), &found.variables[0]);
    assert!(offer.saves_states && offer.can(&["canGetAndSetFMUstate"]));
    let deg = DisplayUnit { name: "deg".to_owned(), factor: 57.5, offset: 2.0 };
    let rad = BaseUnit { exponents: [0, 0, 0, 0, 0, 0, 0, 1], ..BaseUnit::ONE };
    assert_eq!(found.units["rad"], Unit { base: Some(rad), display_units: vec![deg] });
    let item = Item { name: "i".to_owned(), value: 3, description: String::new() };
    assert_eq!(found.items_of(Some("E")), Some(&[item][..]));
    assert_eq!(found.default_experiment, [None, Some(2.0), None]);
    assert_eq!((x.reference, x.min(), x.max(), x.nominal()), (1, Some(-1.0), Some(9.0), 4.0));
    let is_relative = x.attributes.is_relative;
    assert_eq!((&*x.start, is_relative, x.causality), (&["7".to_owned()][..], true, Causality::Parameter));
}

/// A unit that is written has all digits, so it is the same when it is read.
#[cfg(all(feature = "calls", feature = "write"))]
#[test]
fn units_are_read_as_they_are_written() {
    let mut random = fmi_abi::calls::Random::mixed(1);
    for _ in 0..1000 {
        let exponents = std::array::from_fn(|_| random.below(7) as i32 - 3);
        let mut number = |default: f64| {
            let number = f64::from_bits(random.bits());
            if random.chance(0.3) || !number.is_finite() { default } else { number }
        };
        let written = BaseUnit { exponents, factor: number(1.0), offset: number(0.0) };
        let document = written.element("BaseUnit").document().unwrap();
        let document = fmi_abi::xml::parse(&document, "unit").unwrap();
        assert_eq!(BaseUnit::read(document.root_element()), Ok(written));
    }
}

#[test]
fn attributes_that_cannot_be_read_are_reported() {
    let faults = |found: ModelDescription| {
        assert!(found.faults.iter().all(|(fault, _)| *fault == Fault::Value), "{:?}", found.faults);
        found.faults.into_iter().map(|(_, why)| why).collect::<Vec<_>>()
    };
    let display =
        "<UnitDefinitions><Unit name='rad'><DisplayUnit name='deg' factor='57,3'/></Unit></UnitDefinitions>";
    let found = fmi2("", "", display);
    assert!(found.units["rad"].display_units.is_empty(), "a display unit without its factor cannot be used");
    assert_eq!(faults(found), ["line 3: factor of DisplayUnit deg is \"57,3\", not a number"]);
    assert_eq!(
        faults(fmi2("needsExecutionTool='yes'", "", "")),
        ["line 2: needsExecutionTool of CoSimulation is \"yes\", not true, false, 1 or 0"]
    );
    let of = |causality: &str, of_type: &str| faults(fmi2("", &variable("x", "1", causality, of_type), ""));
    assert_eq!(
        of("internal", "<Real/>"),
        ["line 4: causality of ScalarVariable x is \"internal\", not a causality"]
    );
    assert_eq!(of("local", "<Real min='low'/>"), ["line 4: min of Real is \"low\", not a number"]);
    let base = "<UnitDefinitions><Unit name='N'><BaseUnit kg='1.5'/></Unit></UnitDefinitions>";
    assert_eq!(faults(fmi2("", "", base)), ["line 3: kg of BaseUnit is \"1.5\", not an integer of 32 bits"]);
    // Each kind of fault is listed at most 100 times.
    assert_eq!(faults(fmi2("", &variable("x", "-1", "local", "<Real/>").repeat(1000), "")).len(), 100);
}

/// Of the white space, only the blanks of XML are not part of a value.
#[test]
fn a_no_break_space_does_not_separate_values() {
    let variables =
        "<Float64 name='u' valueReference='1' start='1\u{a0}2 3'><Dimension start='2'/></Float64>";
    assert_eq!(fmi3(variables, "").variables[0].start, ["1\u{a0}2", "3"]);
}

#[test]
fn versions_are_those_of_the_schema() {
    for (version, is_read) in [
        ("2.0", true),
        ("3.0", true),
        ("3.1.12", true),
        ("3.0-beta.1", true),
        ("2", false),
        (" 2.0", false),
        ("3.", false),
        ("3.x", false),
        ("3.0.0.0", false),
        ("3.0-", false),
    ] {
        let text = format!("<fmiModelDescription fmiVersion='{version}'/>");
        assert_eq!(ModelDescription::parse(&text).is_ok(), is_read, "{version}");
    }
}

/// FMI 2.0 counts the variables of the file, including those that cannot be read (section 2.2.8).
#[test]
fn a_variable_that_cannot_be_read_does_not_shift_the_others() {
    let structure = "<ModelStructure><Outputs><Unknown index='4' dependencies='3'/><Unknown index='2'/><Unknown index='5'/></Outputs>\
        <Derivatives><Unknown index='6'/></Derivatives></ModelStructure>";
    let variables = [
        variable("a", "1", "local", "<Real/>"),
        variable("skipped", "2", "local", ""),
        variable("u", "3", "input", "<Real start='0'/>"),
        variable("y", "4", "output", "<Real/>"),
        "<ScalarVariable name='unnumbered' causality='output'><Real/></ScalarVariable>".to_owned(),
        variable("der(u)", "6", "local", "<Real derivative='3'/>"),
        variable("der(nothing)", "7", "local", "<Real derivative='9'/>"),
    ];
    let found = fmi2("", &variables.concat(), structure);
    let name = |index: usize| found.variables[index].name.as_str();
    assert_eq!(
        (0..found.variables.len()).map(name).collect::<Vec<_>>(),
        ["a", "u", "y", "der(u)", "der(nothing)"]
    );
    let listed: Vec<_> =
        found.outputs.iter().map(|of| (name(of.variable), of.dependencies.clone())).collect();
    assert_eq!(listed, [("y", Some(vec![1]))]);
    assert_eq!(found.variables[found.derivatives[0].variable].derivative_of.map(name), Some("u"));
    let faults: Vec<_> = found.faults.iter().map(|(fault, why)| (*fault, why.as_str())).collect();
    assert_eq!(
        faults,
        [
            (Fault::Type, "skipped has no type"),
            (Fault::Reference, "unnumbered has no value reference"),
            (Fault::Structure, "der(nothing) is the derivative of 9, which does not exist"),
        ]
    );
}

/// An output whose dependencies cannot be read may depend on everything (section 2.2.8 of FMI 2.0, 2.4.8 of FMI 3.0).
#[test]
fn dependencies_that_do_not_exist_are_not_left_out() {
    let variables = "<Float64 name='u' valueReference='1' causality='input' start='0'/><Float64 name='y' valueReference='2' causality='output'/>";
    for (dependencies, why) in [
        ("1 7", (Fault::Structure, "ModelStructure refers to 7, which does not exist")),
        (
            "1 x",
            (Fault::Value, "line 2: dependencies of Output is \"x\", not an integer from 0 to 4294967295"),
        ),
    ] {
        let output = format!(
            "<ModelStructure><Output valueReference='2' dependencies='{dependencies}'/></ModelStructure>"
        );
        let found = fmi3(variables, &output);
        assert_eq!((found.outputs[0].variable, &found.outputs[0].dependencies), (1, &None));
        assert_eq!(found.faults, [(why.0, why.1.to_owned())]);
    }
    assert_eq!(
        fmi3(variables, "<ModelStructure><Output dependencies='1'/></ModelStructure>").faults,
        [(Fault::Structure, "ModelStructure has an Output without valueReference".to_owned())]
    );
}

/// Start values of strings are elements, so that one without a value must not shift the others.
#[test]
fn a_start_without_value_is_reported() {
    let start = "<Dimension start='2'/><Start/><Start value='b'/>";
    let found = fmi3(&format!("<String name='s' valueReference='1'>{start}</String>"), "");
    assert_eq!(found.variables[0].start, ["", "b"]);
    assert_eq!(found.faults, [(Fault::Attribute, "a Start of s lacks its value".to_owned())]);
}

#[test]
fn aliases_and_unknown_types_of_fmi_3_are_read() {
    let found = fmi3(
        "<Float64 name='y' valueReference='1'><Alias name='z' description='d' displayUnit='deg'/><Alias name='w'/></Float64>\
         <Clock name='c' valueReference='2'/><Float128 name='q' valueReference='3'/>",
        "",
    );
    let aliases: Vec<_> =
        found.variables[0].aliases.iter().map(|of| (of.name.as_str(), of.display_unit.as_deref())).collect();
    assert_eq!((found.variables.len(), aliases), (2, vec![("z", Some("deg")), ("w", None)]));
    assert_eq!(found.faults, [(Fault::Type, "q has the type Float128, which is unknown".to_owned())]);
}

/// These faults do not prevent a run.
#[test]
fn what_counts_once_is_reported() {
    let definitions = "<UnitDefinitions><Unit name='m'/><Unit name='m'/></UnitDefinitions>\
        <TypeDefinitions><Int8Type name='T'/><EnumerationType name='E'><Item name='a' value='1'/><Item name='b' value='1'/></EnumerationType></TypeDefinitions>\
        <DefaultExperiment tolerance='-1'/>\
        <ModelStructure><Output valueReference='1' dependencies='3' dependenciesKind='constant fixed'/><Output valueReference='1'/>\
        <EventIndicator valueReference='2'/></ModelStructure>";
    let variables = "<Float64 name='y' valueReference='1' causality='output' declaredType='T'><Dimension valueReference='2'/></Float64>\
        <Int32 name='n' valueReference='2' start='2'/><Float64 name='u' valueReference='3' causality='input' start='0'/>";
    let found = fmi3(variables, definitions);
    let faults: Vec<_> = found.faults.iter().map(|(fault, why)| (*fault, why.as_str())).collect();
    assert_eq!(
        faults,
        [
            (Fault::Experiment, "the tolerance -1 is negative"),
            (Fault::Unit, "two units are called m"),
            (Fault::Definition, "the item b = 1 of E has the name or the value of another item"),
            (Fault::Definition, "y is of type Float64, but its declaredType is of type Int8"),
            (
                Fault::Dimension,
                "the size of y is the variable 2, which is neither a structural parameter nor a constant of type UInt64"
            ),
            (Fault::Unknown, "an Output of ModelStructure has 2 dependenciesKind, but 1 dependencies"),
            (Fault::Unknown, "ModelStructure lists y twice as Output"),
            (Fault::Unknown, "the event indicator n is not a continuous floating-point number"),
        ]
    );
    assert_eq!((found.outputs.len(), found.default_tolerance), (1, None));
}
