//! Rules that the parts of a model description fulfil together, each with its test.

use crate::description::{Description, Handle, Variable, handle};
use crate::rules::Observation;
use fmi_abi::{Causality, Initial, Standard, Variability, is_structured_name, shown_number};
use std::collections::{BTreeMap, HashSet};

/// Returns a message for each violation of a rule.
type Test = fn(&Description) -> Vec<String>;

/// Rules with their tests.
const TESTS: [(&str, Test); 10] = [
    ("description.step-size", step_size),
    ("description.initial-unknowns", missing_initial_unknowns),
    ("description.initial-unknowns", other_initial_unknowns),
    ("description.names", structured_names),
    ("description.names", names_of_aliases),
    ("description.references", aliases),
    ("description.reinit", reinit),
    ("description.start", start_of_time),
    ("description.start", number_of_starts),
    ("description.structure", derivatives),
];

/// Returns the broken rules.
pub fn broken(description: &Description) -> Vec<Observation> {
    let of_test =
        |(rule, test): (&'static str, Test)| test(description).into_iter().map(move |why| (rule, why));
    TESTS.into_iter().flat_map(of_test).collect()
}

/// Returns a message for each variable that breaks a rule.
fn each(description: &Description, test: impl Fn(usize, &Variable) -> Option<String>) -> Vec<String> {
    description.variables.iter().enumerate().filter_map(|(index, of)| test(index, of)).collect()
}

/// The step size is the preferred one of Co-Simulation (section 2.2.5 of FMI 2.0, 2.4.6 of FMI 3.0), whose steps are longer than 0 (section
/// 4.2.1 of FMI 3.0).
fn step_size(description: &Description) -> Vec<String> {
    let is_wrong = |size: &f64| *size < 0.0 || *size == 0.0 && description.co_simulation.is_some();
    let size = description.default_experiment[2].filter(is_wrong);
    size.map(|size| format!("the step size {} is not positive", shown_number(size))).into_iter().collect()
}

/// Continuous states and their derivatives. In FMUs that only have Co-Simulation without directional derivatives, the list of derivatives
/// is ignored (section 2.2.8 of FMI 2.0, 2.4.8 of FMI 3.0), so the second value is false.
fn states_and_derivatives(description: &Description) -> (HashSet<usize>, bool) {
    let derivatives = description.derivatives.iter().map(|unknown| unknown.variable);
    let counts = description.model_exchange.is_some()
        || description.co_simulation.as_ref().is_some_and(|offer| offer.directional_derivatives);
    (description.states().into_iter().chain(derivatives).collect(), counts)
}

/// Whether the initialization calculates a variable, because of its causality or because it is one of these states or derivatives.
fn is_calculated(variable: &Variable, is_state: bool) -> bool {
    let is_open = matches!(variable.initial, Some(Initial::Approx | Initial::Calculated));
    variable.causality == Causality::CalculatedParameter
        || is_open && (variable.causality == Causality::Output || is_state)
}

fn missing_initial_unknowns(description: &Description) -> Vec<String> {
    let listed: HashSet<usize> = description.initial_unknowns.iter().map(|of| of.variable).collect();
    let (states, count) = states_and_derivatives(description);
    each(description, |index, variable| {
        let is_needed = variable.base.is_some()
            && !variable.clocked
            && is_calculated(variable, count && states.contains(&index))
            && !listed.contains(&index);
        is_needed.then(|| format!("{} is calculated, but is not among the initial unknowns", variable.name))
    })
}

fn other_initial_unknowns(description: &Description) -> Vec<String> {
    let (states, _) = states_and_derivatives(description);
    let unknowns = description.initial_unknowns.iter().map(|unknown| unknown.variable);
    let other = |index: usize| {
        let variable = &description.variables[index];
        let is_other =
            variable.base.is_some() && !variable.clocked && !is_calculated(variable, states.contains(&index));
        is_other.then(|| {
            let what = "an output, state or derivative that is calculated, or a calculated parameter";
            format!("the initial unknown {} is not {what}", variable.name)
        })
    };
    unknowns.filter_map(other).collect()
}

fn structured_names(description: &Description) -> Vec<String> {
    each(description, |_, variable| {
        let is_wrong = description.structured_names && !is_structured_name(&variable.name);
        is_wrong.then(|| format!("{:?} is not a structured name", variable.name))
    })
}

/// Only FMI 3.0 has elements for aliases.
fn names_of_aliases(description: &Description) -> Vec<String> {
    let mut names: HashSet<&str> = description.variables.iter().map(|of| of.name.as_str()).collect();
    let aliases = description.variables.iter().flat_map(|of| &of.aliases);
    let again = aliases.filter(|alias| !names.insert(&alias.name));
    again.map(|alias| format!("the name of the alias {:?} is not unique", alias.name)).collect()
}

/// In FMI 2.0, variables of one type with one value reference are equal at all times.
fn aliases(description: &Description) -> Vec<String> {
    if description.standard == Standard::Fmi3 {
        return Vec::new();
    }
    let mut sets: BTreeMap<Handle, Vec<&Variable>> = BTreeMap::new();
    for variable in description.variables.iter().filter(|of| of.base.is_some()) {
        sets.entry(handle(description.standard, variable)).or_default().push(variable);
    }
    sets.values().filter_map(|set| unequal(set)).collect()
}

/// Describes why variables cannot be aliases; `None` if they can.
fn unequal(set: &[&Variable]) -> Option<String> {
    let two = |test: &dyn Fn(&Variable) -> bool, what: &str| {
        let mut found = set.iter().filter(|of| test(of));
        let (one, other) = (&found.next()?.name, &found.next()?.name);
        Some(format!("{one} and {other} have one value reference, but {what}"))
    };
    let is_free = |of: &Variable| {
        matches!(of.causality, Causality::Input | Causality::Parameter | Causality::Independent)
    };
    let is_constant = |of: &Variable| of.variability == Variability::Constant;
    let differ = |differ: &dyn Fn(&Variable, &Variable) -> bool, what: &str| {
        let first = set.first()?;
        let other = set.iter().find(|other| differ(first, other))?;
        Some(format!("{} and {} have one value reference, but {what}", first.name, other.name))
    };
    let starts = |of: &Variable| (of.starts(), of.starts().is_empty().then(|| of.start.clone()));
    two(&is_free, "both are set by the importer")
        .or_else(|| two(&|of| !is_constant(of) && !of.start.is_empty(), "both have a start value"))
        .or_else(|| differ(&|one, other| is_constant(one) != is_constant(other), "only one is constant"))
        .or_else(|| {
            differ(&|one, other| is_constant(one) && starts(one) != starts(other), "other start values")
        })
        .or_else(|| differ(&|one, other| one.attributes.unit != other.attributes.unit, "other units"))
}

/// FMI 3.0 ignores the attribute in other interface types than Model Exchange.
fn reinit(description: &Description) -> Vec<String> {
    let states: HashSet<Handle> = description
        .states()
        .into_iter()
        .map(|index| handle(description.standard, &description.variables[index]))
        .collect();
    let counts = description.standard == Standard::Fmi2 || description.model_exchange.is_some();
    each(description, |_, variable| {
        let is_wrong = counts && variable.reinit && !states.contains(&handle(description.standard, variable));
        is_wrong.then(|| format!("{} has reinit, but is not a continuous state", variable.name))
    })
}

fn start_of_time(description: &Description) -> Vec<String> {
    each(description, |_, variable| {
        let is_wrong = variable.causality == Causality::Independent && !variable.start.is_empty();
        is_wrong.then(|| format!("{} is independent and has a start value", variable.name))
    })
}

/// In FMI 2.0, each variable has one value, which the schema requires.
fn number_of_starts(description: &Description) -> Vec<String> {
    each(description, |_, variable| {
        let (count, size) = (variable.start.len(), variable.size?);
        let is_wrong = description.standard == Standard::Fmi3 && count > 1 && count != size;
        is_wrong.then(|| format!("{} has {count} start values and {size} elements", variable.name))
    })
}

/// The reverse is not required: a variable with the attribute `derivative` is listed only if it is a state derivative (section 2.2.8 of
/// FMI 2.0).
fn derivatives(description: &Description) -> Vec<String> {
    let variables = description.derivatives.iter().map(|unknown| &description.variables[unknown.variable]);
    let lacking = variables.filter(|variable| variable.derivative_of.is_none());
    let message = |variable: &Variable| {
        format!("{} is among the derivatives, but lacks the attribute derivative", variable.name)
    };
    lacking.map(message).collect()
}

#[cfg(test)]
mod tests {
    use crate::description::Description;

    /// FMI version, rule, and the changes of a correct description that break it: the string that is replaced, and the replacement.
    type Broken = (u32, &'static str, &'static [(&'static str, &'static str)]);

    const END: &str = "</ModelVariables>";
    const DEFINITIONS: &str = "<LogCategories>";
    const EXPERIMENT: &str = r#"stepSize="0.01""#;

    #[rustfmt::skip]
    const BROKEN: [Broken; 37] = [
        (2, "initial-unknowns", &[(r#"<Unknown index="9" dependencies="4"/>"#, "")]),
        (2, "initial-unknowns", &[("<InitialUnknowns>", r#"<InitialUnknowns><Unknown index="1"/>"#)]),
        (3, "initial-unknowns", &[(r#"<InitialUnknown valueReference="5" dependencies=""/>"#, "")]),
        (3, "initial-unknowns", &[(r#"<InitialUnknown valueReference="9""#, r#"<InitialUnknown valueReference="14"/><InitialUnknown valueReference="9""#)]),
        (2, "structure", &[(r#"dependencies="4 5"/>"#, r#"dependencies="4 5" dependenciesKind="constant"/>"#)]),
        (3, "structure", &[(r#"dependencies="4 5"/>"#, r#"dependenciesKind="constant"/>"#)]),
        (2, "structure", &[("<Outputs>", r#"<Outputs><Unknown index="9"/>"#)]),
        (2, "combination", &[(r#""input" variability"#, r#""input" initial="exact" variability"#)]),
        (2, "start", &[(r#""independent" variability="continuous"><Real/>"#, r#""independent" variability="continuous"><Real start="0"/>"#)]),
        (3, "start", &[(r#""independent" variability="continuous""#, r#""independent" variability="continuous" start="0""#)]),
        (2, "references", &[(END, r#"<ScalarVariable name="a" valueReference="4" causality="input"><Real start="0"/></ScalarVariable></ModelVariables>"#)]),
        (2, "references", &[(r#""spring" valueReference="2""#, r#""spring" valueReference="4""#)]),
        (2, "references", &[(END, r#"<ScalarVariable name="a" valueReference="5" variability="constant"><Real start="0"/></ScalarVariable></ModelVariables>"#)]),
        (2, "references", &[(END, r#"<ScalarVariable name="a" valueReference="20" variability="constant"><Real start="0"/></ScalarVariable>
            <ScalarVariable name="b" valueReference="20" variability="constant"><Real start="1"/></ScalarVariable></ModelVariables>"#)]),
        (2, "references", &[(DEFINITIONS, r#"<UnitDefinitions><Unit name="m"/></UnitDefinitions><LogCategories>"#),
            (END, r#"<ScalarVariable name="a" valueReference="5"><Real unit="m"/></ScalarVariable></ModelVariables>"#)]),
        (2, "reinit", &[(END, r#"<ScalarVariable name="a" valueReference="20"><Real reinit="true"/></ScalarVariable></ModelVariables>"#)]),
        (3, "reinit", &[(END, r#"<Float64 name="a" valueReference="20" reinit="true"/></ModelVariables>"#)]),
        (2, "types", &[(DEFINITIONS, r#"<TypeDefinitions><SimpleType name="T"><Enumeration><Item name="a" value="1"/><Item name="b" value="1"/></Enumeration></SimpleType></TypeDefinitions><LogCategories>"#)]),
        (2, "names", &[(r#"guid="wagon""#, r#"guid="wagon" variableNamingConvention="structured""#), (r#"name="power""#, r#"name="power of x""#)]),
        (3, "names", &[(r#"derivative="5"/>"#, r#"derivative="5"><Alias name="x"/></Float64>"#)]),
        (3, "dimensions", &[(END, r#"<Float64 name="a" valueReference="20"><Dimension valueReference="10"/></Float64></ModelVariables>"#)]),
        (3, "dimensions", &[(END, r#"<Float64 name="a" valueReference="20"><Dimension/></Float64></ModelVariables>"#)]),
        (3, "dimensions", &[(END, r#"<UInt64 name="n" valueReference="21" causality="structuralParameter" start="2"/>
            <Float64 name="a" valueReference="20"><Dimension start="2" valueReference="21"/></Float64></ModelVariables>"#)]),
        (3, "start", &[(END, r#"<Float64 name="a" valueReference="20" causality="parameter" start="1 2"><Dimension start="3"/></Float64></ModelVariables>"#)]),
        (3, "structure", &[(END, r#"<Float64 name="a" valueReference="20" derivative="77"/></ModelVariables>"#)]),
        (3, "structure", &[(r#"<EventIndicator valueReference="6"/>"#, r#"<EventIndicator valueReference="10"/>"#)]),
        (2, "step-size", &[(EXPERIMENT, r#"stepSize="0""#)]),
        (3, "tolerance", &[(EXPERIMENT, r#"stepSize="0.01" tolerance="-1e-3""#)]),
        (2, "types", &[(DEFINITIONS, r#"<TypeDefinitions><SimpleType name="T"><Integer/></SimpleType></TypeDefinitions><LogCategories>"#),
            (r#"<Real start="2"/>"#, r#"<Real declaredType="T" start="2"/>"#)]),
        (3, "types", &[(DEFINITIONS, r#"<TypeDefinitions><Int32Type name="T"/></TypeDefinitions><LogCategories>"#), (r#" start="2""#, r#" declaredType="T" start="2""#)]),
        (2, "units", &[(DEFINITIONS, r#"<UnitDefinitions><Unit name="m"/><Unit name="m"/></UnitDefinitions><LogCategories>"#)]),
        (2, "units", &[(DEFINITIONS, r#"<UnitDefinitions><Unit name="m"><DisplayUnit name="mm" factor="1000"/><DisplayUnit name="mm" factor="1"/></Unit></UnitDefinitions><LogCategories>"#)]),
        (3, "units", &[(DEFINITIONS, r#"<UnitDefinitions><Unit name="m"><DisplayUnit name="mm" factor="0"/></Unit></UnitDefinitions><LogCategories>"#)]),
        (2, "interfaces", &[(DEFINITIONS, r#"<CoSimulation modelIdentifier="other"/><LogCategories>"#)]),
        (3, "structure", &[(END, r#"<Float64 name="a" valueReference="20" derivative="20"/></ModelVariables>"#)]),
        (3, "types", &[(DEFINITIONS, r#"<TypeDefinitions><Float64Type name="T"/><Int32Type name="T"/></TypeDefinitions><LogCategories>"#)]),
        (3, "types", &[(DEFINITIONS, r#"<TypeDefinitions><EnumerationType name="T"><Item name="a" value="1"/><Item name="a" value="2"/></EnumerationType></TypeDefinitions><LogCategories>"#)]),
    ];

    /// Names of the rules that the wagon breaks with these changes.
    fn broken(fmi: u32, changes: &[(&str, &str)]) -> Vec<&'static str> {
        let mut text = fmu_test_kit::c_models::read(&format!("wagon{fmi}.xml"));
        for (before, after) in changes {
            assert!(text.contains(before), "{before}");
            text = text.replacen(before, after, 1);
        }
        let description = Description::parse(&text).expect("a model description");
        let wrong = description.wrong.iter().cloned().chain(super::broken(&description));
        wrong.filter_map(|(rule, _)| rule.strip_prefix("description.")).collect()
    }

    #[test]
    fn each_mistake_is_found_by_its_rule_only() {
        for (fmi, rule, changes) in BROKEN {
            assert_eq!(broken(fmi, changes), [rule], "{changes:?}");
        }
    }

    /// Aliases of a parameter or a constant, arrays with one start value or a structural size, an Enumeration of a declared type, and a step
    /// size of 0 in Model Exchange are correct.
    #[test]
    fn unusual_descriptions_are_correct() {
        let alias = r#"<ScalarVariable name="a" valueReference="1" causality="calculatedParameter" variability="fixed"><Real/></ScalarVariable>
            <ScalarVariable name="b" valueReference="20" variability="constant"><Real start="1"/></ScalarVariable>
            <ScalarVariable name="c" valueReference="20" variability="constant"><Real start="1.0"/></ScalarVariable></ModelVariables>"#;
        let unknown = r#"<Unknown index="11" dependencies=""/><Unknown index="15"/></InitialUnknowns>"#;
        let array = r#"<UInt64 name="n" valueReference="20" causality="structuralParameter" start="3"/>
            <Float64 name="a" valueReference="21" causality="parameter" start="1"><Dimension valueReference="20"/><Alias name="b"/></Float64>
            <Enumeration name="e" declaredType="T" valueReference="22"/></ModelVariables>"#;
        let types = r#"<TypeDefinitions><EnumerationType name="T"><Item name="a" value="1"/></EnumerationType></TypeDefinitions><LogCategories>"#;
        let last = "<Unknown index=\"11\" dependencies=\"\"/>\n    </InitialUnknowns>";
        let names = (r#"guid="wagon""#, r#"guid="wagon" variableNamingConvention="structured""#);
        let offers = [
            ("<CoSimulation ", "<!-- "),
            (
                r#"providesDirectionalDerivative="true"/>
  <LogCategories>"#,
                "--><LogCategories>",
            ),
            (EXPERIMENT, r#"stepSize="0""#),
        ];
        assert_eq!(broken(2, &[names, (END, alias), (last, unknown)]), [""; 0]);
        assert_eq!(broken(3, &[(END, array), (DEFINITIONS, types)]), [""; 0]);
        assert_eq!(broken(2, &offers), [""; 0]);
    }

    /// Checks the descriptions of the other correct test models, and those of fmu-package and of this repository.
    #[test]
    fn descriptions_of_correct_models_break_no_rule() {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let mut count = 0;
        for directory in [
            "crates/fmu-test-kit/models",
            "crates/fmu-package/tests/descriptions/expected",
            "modelDescription",
            "examples/controller/modelDescription",
        ] {
            for entry in std::fs::read_dir(root.join(directory)).into_iter().flatten().flatten() {
                let path = entry.path();
                let text = std::fs::read_to_string(&path).unwrap_or_default();
                // These are like FMUs of other producers, which are not all correct.
                let is_wrong =
                    ["misbehaving", "integrator"].iter().any(|name| path.to_string_lossy().contains(name));
                if is_wrong || !text.contains("<fmiModelDescription") {
                    continue;
                }
                if let Ok(description) = Description::parse(&text) {
                    count += 1;
                    let wrong = [&description.wrong[..], &super::broken(&description)].concat();
                    assert!(wrong.is_empty(), "{}: {wrong:?}", path.display());
                }
            }
        }
        assert!(count > 12, "{count}");
    }
}
