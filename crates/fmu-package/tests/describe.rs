//! The description of a model whose structure is known.

mod common;

use common::fmi2::describe;
use fmi_schema::fmi2::{DependenciesKind, Fmi2ModelDescription};
use fmi_schema::traits::FmiModelDescription;
use fmu_export::*;
use fmu_package::structure::DependencyKind::{self, Constant, Dependent, Fixed, Tunable};
use fmu_package::structure::Unknown;
use fmu_package::{Changes, NO_GUID};

const SHARE: Type = Type::real("Share", &units::ONE).min(0.0).max(1.0);
const COUNT: Type = Type::integer("Count").min_integer(-9).max_integer(3);

/// The same model with other capabilities, each in a module of its own.
macro_rules! toys {
    ($($name:ident: $smooth:literal, $first:ident $(+ $next:ident)*;)+) => { $(
        mod $name {
            use super::*;

            #[derive(Clone)]
            pub struct Toy {
                u: f64,
                v: f64,
                x: f64,
                p: f64,
                n: i32,
                b: bool,
            }

            variables! { for Toy;
                /// Input
                u = input(&NUMBER) in u;
                /// Input with <signs> & "quotes"
                v = input(&NUMBER) in v;
                /// State
                x = output(&NUMBER).state() in x;
                /// 3 u - p x
                der_x as "der(x)" = local(&NUMBER).derivative_of(x) by |toy| 3.0 * toy.u - toy.p * toy.x;
                /// 2 u + n x
                y = output(&NUMBER) by |toy| 2.0 * toy.u + f64::from(toy.n) * toy.x;
                /// x v, or x if not b
                z = output(&NUMBER) by |toy| toy.x * if toy.b { toy.v } else { 1.0 };
                /// Five; the input cancels, up to rounding
                five = output(&NUMBER) by |toy| (toy.u / 3.0 + 5.0) - toy.u / 3.0;
                /// Real parameter
                p = parameter(&SHARE) in p;
                /// Integer parameter
                n = parameter(&COUNT) in n;
                /// Boolean parameter
                b = parameter(&BOOLEAN) in b;
            }

            impl Model for Toy {
                const INFO: Info = Info {
                    default_experiment: DefaultExperiment {
                        start_time: 0.0,
                        stop_time: 1.0,
                        step_size: 1e-3,
                        tolerance: 1e-7,
                    },
                    smooth: $smooth,
                    version: "1",
                    ..Info::new("Toy", "toy", "{toy}")
                };

                fn new(_: &Setup) -> Result<Self, Error> {
                    Ok(Self { u: 0.0, v: 0.0, x: 2.0, p: 0.1, n: 1, b: true })
                }

                fn update(&mut self) -> Result<(), Error> {
                    if self.p < f64::from(self.n) / 20.0 {
                        return Err(Error::new("p is too small for n"));
                    }
                    Ok(())
                }
            }

            toys!(@impl $first);
            $( toys!(@impl $next); )*
            offer!(Toy: $first $(+ $next)*);
        }
    )+ };
    (@impl CoSimulation) => {
        impl CoSimulation for Toy {
            fn step(&mut self, _: Step) -> Result<Stepped, Error> {
                Ok(Stepped::Done)
            }
        }
    };
    (@impl ModelExchange) => {
        impl ModelExchange for Toy {}
    };
    (@impl Partials) => {
        impl Partials for Toy {
            fn partial(&self, unknown: Name, known: Name) -> Option<f64> {
                let (z_x, z_v) = if self.b { (self.v, self.x) } else { (1.0, 0.0) };
                Some(match (unknown, known) {
                    (Name::der_x, Name::u) => 3.0,
                    (Name::der_x, Name::x) => -self.p,
                    (Name::der_x, Name::p) => -self.x,
                    (Name::y, Name::u) => 2.0,
                    (Name::y, Name::x) => f64::from(self.n),
                    (Name::z, Name::x) => z_x,
                    (Name::z, Name::v) => z_v,
                    (Name::x, Name::x) => 1.0,
                    _ => 0.0,
                })
            }
        }
    };
}

toys! {
    everything: true, CoSimulation + ModelExchange + Partials;
    no_derivatives: true, CoSimulation + ModelExchange;
    not_smooth: false, CoSimulation + ModelExchange + Partials;
    steps_only: true, CoSimulation;
    nothing: true, Partials;
}

const U: u32 = everything::Name::u as u32;
const V: u32 = everything::Name::v as u32;
const X: u32 = everything::Name::x as u32;
const DER_X: u32 = everything::Name::der_x as u32;
const Y: u32 = everything::Name::y as u32;
const Z: u32 = everything::Name::z as u32;
const FIVE: u32 = everything::Name::five as u32;
const P: u32 = everything::Name::p as u32;
const N: u32 = everything::Name::n as u32;
const B: u32 = everything::Name::b as u32;

type Lists = Vec<(u32, Vec<(u32, DependencyKind)>)>;

fn lists<M: Exported>(tunable: bool) -> [Lists; 3] {
    let structure = common::structure::<M>(tunable).unwrap();
    let pair = |unknown: Unknown| (unknown.vr, unknown.dependencies);
    [structure.outputs, structure.derivatives, structure.initial_unknowns]
        .map(|list| list.into_iter().map(pair).collect())
}

fn initial_unknowns() -> Lists {
    vec![
        (DER_X, vec![(U, Constant), (X, Dependent), (P, Dependent)]),
        (Y, vec![(U, Constant), (X, Dependent), (N, Dependent)]),
        (Z, vec![(V, Dependent), (X, Dependent), (B, Dependent)]),
        (FIVE, vec![]),
    ]
}

#[test]
fn kinds_say_what_a_factor_is_made_of() {
    for (tunable, kind) in [(false, Fixed), (true, Tunable)] {
        let [outputs, derivatives, initial] = lists::<everything::Toy>(tunable);
        let expected: Lists = vec![
            (X, vec![(X, Constant)]),
            (Y, vec![(U, Constant), (X, kind)]),
            (Z, vec![(V, Dependent), (X, Dependent)]),
            (FIVE, vec![]),
        ];
        assert_eq!(outputs, expected);
        assert_eq!(derivatives, [(DER_X, vec![(U, Constant), (X, kind)])]);
        assert_eq!(initial, initial_unknowns());
    }
}

#[test]
fn without_derivatives_the_values_tell() {
    let [outputs, derivatives, initial] = lists::<no_derivatives::Toy>(false);
    let expected: Lists = vec![
        (X, vec![(X, Constant)]),
        (Y, vec![(U, Dependent), (X, Dependent)]),
        (Z, vec![(V, Dependent), (X, Dependent)]),
        (FIVE, vec![]),
    ];
    assert_eq!(outputs, expected);
    assert_eq!(derivatives, [(DER_X, vec![(U, Dependent), (X, Dependent)])]);
    assert_eq!(initial, initial_unknowns());
}

/// Trying a few points proves nothing then, whatever the derivatives are there.
#[test]
fn without_smooth_equations_nothing_is_ruled_out() {
    let [outputs, derivatives, initial] = lists::<not_smooth::Toy>(false);
    let all = |knowns: &[u32]| knowns.iter().map(|known| (*known, Dependent)).collect::<Vec<_>>();
    let of_all = |unknown| (unknown, all(&[U, V, X]));
    assert_eq!(outputs, [(X, vec![(X, Constant)]), of_all(Y), of_all(Z), of_all(FIVE)]);
    assert_eq!(derivatives, [of_all(DER_X)]);
    let initial_knowns = all(&[U, V, X, P, N, B]);
    assert_eq!(initial, [DER_X, Y, Z, FIVE].map(|unknown| (unknown, initial_knowns.clone())));
}

/// Section 2.2.8: then neither state derivatives nor dependencies on states are listed.
#[test]
fn co_simulation_without_derivatives_keeps_its_states_to_itself() {
    let [outputs, derivatives, initial] = lists::<steps_only::Toy>(false);
    let expected: Lists =
        vec![(X, vec![]), (Y, vec![(U, Dependent)]), (Z, vec![(V, Dependent)]), (FIVE, vec![])];
    assert_eq!(outputs, expected);
    assert_eq!(derivatives, []);
    assert_eq!(initial, initial_unknowns()[1..]);
}

fn text<M: Exported>(changes: &Changes) -> String {
    describe::<M>(changes).unwrap()
}

#[test]
fn the_text_is_what_the_schema_wants() {
    let text = text::<everything::Toy>(&Changes::default());
    assert!(text.starts_with(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiModelDescription\n  fmiVersion=\"2.0\"\n"
    ));
    for line in [
        r#"  <ModelExchange modelIdentifier="toy" completedIntegratorStepNotNeeded="true" canNotUseMemoryManagementFunctions="true" canGetAndSetFMUstate="true" canSerializeFMUstate="true" providesDirectionalDerivative="true"/>"#,
        r#"  <CoSimulation modelIdentifier="toy" canHandleVariableCommunicationStepSize="true" canInterpolateInputs="false" maxOutputDerivativeOrder="0" canNotUseMemoryManagementFunctions="true" canGetAndSetFMUstate="true" canSerializeFMUstate="true" providesDirectionalDerivative="true"/>"#,
        r#"      <BaseUnit/>"#,
        r#"      <Integer min="-9" max="3"/>"#,
        r#"      <Real quantity="Share" unit="1" min="0" max="1"/>"#,
        r#"    <Category name="logStatusWarning" description="Something is odd; the simulation goes on"/>"#,
        r#"  <DefaultExperiment startTime="0" stopTime="1" tolerance="0.0000001" stepSize="0.001"/>"#,
        r#"    <ScalarVariable name="v" valueReference="1" description="Input with &lt;signs&gt; &amp; &quot;quotes&quot;" causality="input" variability="continuous">"#,
        r#"      <Real declaredType="Number" start="2" quantity="Number" unit="1"/>"#,
        r#"      <Real declaredType="Number" derivative="3" quantity="Number" unit="1"/>"#,
        r#"    <ScalarVariable name="n" valueReference="8" description="Integer parameter" causality="parameter" variability="fixed" initial="exact">"#,
        r#"      <Integer declaredType="Count" start="1" min="-9" max="3"/>"#,
        r#"      <Boolean start="true"/>"#,
        r#"      <Unknown index="7" dependencies="" dependenciesKind=""/>"#,
    ] {
        assert!(text.lines().any(|other| other == line), "{line}\n is not in\n{text}");
    }
    let place = |element: &str| text.find(&format!("<{element}")).unwrap();
    let order = [
        "ModelExchange",
        "CoSimulation",
        "UnitDefinitions",
        "TypeDefinitions",
        "LogCategories",
        "DefaultExperiment",
        "ModelVariables",
        "ModelStructure",
        "Outputs",
        "Derivatives",
        "InitialUnknowns",
    ];
    assert!(order.is_sorted_by_key(|element| place(element)), "{text}");
}

#[test]
fn it_reads_back() {
    let text = text::<everything::Toy>(&Changes::default());
    let read = Fmi2ModelDescription::deserialize(&text).unwrap();
    let table = everything::Toy::TABLE;
    assert_eq!(read.model_variables.variables.len(), table.len());
    assert_eq!(read.model_variables.variables[1].description.as_deref(), Some(table[1].description()));
    assert_eq!(read.number_of_event_indicators, Some(0));
    let unknowns = &read.model_structure.initial_unknowns.unknowns;
    assert_eq!(unknowns.iter().map(|unknown| unknown.index).collect::<Vec<_>>(), [4, 5, 6, 7]);
    assert_eq!(unknowns[0].dependencies, [1, 3, 8]);
    let kinds = [DependenciesKind::Constant, DependenciesKind::Dependent, DependenciesKind::Dependent];
    assert_eq!(unknowns[0].dependencies_kind, kinds);
}

#[test]
fn lists_that_would_be_empty_are_left_out() {
    let text = text::<steps_only::Toy>(&Changes::default());
    for absent in ["<Derivatives", "<ModelExchange", "numberOfEventIndicators"] {
        assert!(!text.contains(absent), "{text}");
    }
}

#[test]
fn changes_are_made_and_nothing_else() {
    let changes =
        Changes { source_files: Vec::new(), guid: Some("{other}".into()), tunable_parameters: true };
    let before = text::<everything::Toy>(&Changes::default());
    let expected = before
        .replace("{toy}", "{other}")
        .replace("variability=\"fixed\"", "variability=\"tunable\"")
        .replace("\"constant fixed\"", "\"constant tunable\"");
    assert_eq!(text::<everything::Toy>(&changes), expected);
}

#[test]
fn a_model_that_offers_nothing_is_refused() {
    let error = describe::<nothing::Toy>(&Changes::default()).unwrap_err().to_string();
    assert_eq!(error, "Toy offers neither Co-Simulation nor Model Exchange");
}

#[test]
fn a_library_that_is_compiled_without_a_guid_has_zeros() {
    assert_eq!(info!("Toy", "toy").guid, NO_GUID);
}
