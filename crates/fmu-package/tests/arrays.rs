//! The descriptions of models with arrays: one variable in FMI 3.0, a scalar for each element in FMI 2.0.

mod common;

use common::{fmi2, fmi3};
use fmi_schema::fmi2::Fmi2ModelDescription;
use fmi_schema::traits::FmiModelDescription;
use fmu_export::*;
use fmu_package::structure::DependencyKind::{Constant, Dependent, Fixed};
use fmu_package::structure::{ModelStructure, Unknown};
use fmu_package::{Changes, Terminal, terminals};

#[path = "../../fmu-export/tests/models/rod.rs"]
#[allow(dead_code)]
mod rod;

/// The lines of the description of FMI 3.0 that have this, without the space before them.
fn lines(text: &str, word: &str) -> Vec<String> {
    text.lines().filter(|line| line.contains(word)).map(|line| line.trim().to_owned()).collect()
}

#[test]
fn of_fmi2() {
    let text = fmi2::describe::<rod::Rod>(&Changes::default()).unwrap();
    let description = Fmi2ModelDescription::deserialize(&text).unwrap();
    assert!(text.contains(r#"variableNamingConvention="structured""#));
    let variables = &description.model_variables.variables;
    let names: Vec<_> = variables.iter().map(|of| of.name.as_str()).collect();
    assert_eq!(names[..3], ["wall", "T[1]", "T[2]"]);
    for name in ["der(T[8])", "limits[2,1]", "labels[2]", "hot[1]", "switches[2]"] {
        assert!(names.contains(&name), "{name}");
    }
    // The derivative of each state is that of the same element.
    let states: Vec<_> = (2..=9).map(|index| format!(r#"derivative="{index}""#)).collect();
    let rates = lines(&text, r#"derivative=""#);
    assert!(
        rates.len() == 8 && rates.iter().zip(&states).all(|(rate, state)| rate.contains(state)),
        "{rates:?}"
    );
    assert!(lines(&text, r#"<Real declaredType="Capacity" start="2.125""#).len() == 1);
}

#[test]
fn of_fmi3() {
    let text = fmi3::describe::<rod::Rod>(&Changes::default()).unwrap();
    let of = |name: &str| {
        let begin = text.find(&format!(r#"name="{name}""#)).unwrap();
        let end = text[begin..].find("\n    </").or_else(|| text[begin..].find("/>")).unwrap();
        text[begin..begin + end].split_whitespace().collect::<Vec<_>>().join(" ")
    };
    assert!(of("T").contains(r#"valueReference="2""#));
    assert!(of("T").ends_with(r#"start="20 21 22 23 24 25 26 27"> <Dimension start="8"/>"#), "{}", of("T"));
    assert!(of("der(T)").ends_with(r#"derivative="2"> <Dimension start="8"/>"#), "{}", of("der(T)"));
    assert!(
        of("limits").ends_with(r#"start="10 25 12.5 30"> <Dimension start="2"/> <Dimension start="2"/>"#),
        "{}",
        of("limits")
    );
    let labels = r#"<Dimension start="2"/> <Start value="the near half"/> <Start value="the far half"/>"#;
    assert!(of("labels").ends_with(labels), "{}", of("labels"));
    assert!(of("switches").contains(r#"start="3 0""#) && of("hot").contains(r#"start="false false"#));
    assert!(!text.contains("T[") && text.contains(r#"name="time" valueReference="52""#));
    let derivative = r#"<ContinuousStateDerivative valueReference="14" dependencies="1 2 10 12 25 33""#;
    assert_eq!(lines(&text, derivative).len(), 1, "{:?}", lines(&text, "ContinuousStateDerivative"));
}

#[derive(Clone)]
struct Chain {
    x: [f64; 2],
    u: [f64; 2],
    p: f64,
}

variables! { for Chain;
    /// States
    x = output(&NUMBER).state() in x;
    /// Of the first the input, of the second both
    der_x as "der(x)" = local(&NUMBER).derivative_of(x) by |c| [c.u[0], c.p * c.x[0] + c.u[1].sin()];
    /// Inputs
    u = input(&NUMBER) in u;
    /// Parameter
    p = parameter(&NUMBER) in p;
}

impl Model for Chain {
    const INFO: Info = Info { smooth: true, guid: "{chain}", ..info!("Chain", "chain") };

    fn new(_: &Setup) -> Result<Self, Error> {
        Ok(Self { x: [1.0, 2.0], u: [0.5; 2], p: 3.0 })
    }
}

impl ModelExchange for Chain {}

impl Partials for Chain {
    fn partial(&self, unknown: Name, known: Name) -> Option<f64> {
        self.element_partial((unknown, 0), Some((known, 0)), false)
    }

    fn element_partial(&self, unknown: (Name, usize), known: Option<(Name, usize)>, _: bool) -> Option<f64> {
        Some(match (unknown, known) {
            ((Name::x, i), Some((Name::x, j))) => f64::from(u8::from(i == j)),
            ((Name::der_x, 0), Some((Name::u, 0))) => 1.0,
            ((Name::der_x, 1), Some((Name::x, 0))) => self.p,
            ((Name::der_x, 1), Some((Name::u, 1))) => self.u[1].cos(),
            (_, Some((Name::p, _))) => return None,
            _ => 0.0,
        })
    }
}

offer!(Chain: ModelExchange + Partials);

/// Each element has its own dependencies in FMI 2.0; an array has those of all, each as the least constant of them.
#[test]
fn dependencies() {
    let of_fmi2 = common::structure::<Chain>(false).unwrap().derivatives;
    let unknown = |vr, dependencies| Unknown { vr, dependencies };
    assert_eq!(of_fmi2, [unknown(2, vec![(4, Constant)]), unknown(3, vec![(0, Fixed), (5, Dependent)])]);
    let of_fmi3 = ModelStructure::of_fmi3(&common::model::<Chain>(), false).unwrap();
    assert_eq!(of_fmi3.derivatives, [unknown(2, vec![(0, Fixed), (4, Dependent), (6, Dependent)])]);
    assert_eq!(of_fmi3.outputs, [unknown(0, vec![(0, Constant)])]);
}

macro_rules! toys {
    ($($name:ident { $($table:tt)+ })+) => {
        $(mod $name {
            use super::*;

            #[derive(Clone)]
            #[allow(dead_code)]
            pub struct Toy {
                pub values: [f64; 2],
                pub x: f64,
            }

            variables! { for Toy; $($table)+ }

            impl Model for Toy {
                const INFO: Info = Info { guid: "{toy}", ..info!("Toy", "toy") };

                fn new(_: &Setup) -> Result<Self, Error> {
                    Ok(Self { values: [0.0; 2], x: 0.0 })
                }
            }

            impl CoSimulation for Toy {
                fn step(&mut self, _: Step) -> Result<Stepped, Error> {
                    Ok(Stepped::Done)
                }
            }

            offer!(Toy: CoSimulation);
        })+
    };
}

toys! {
    flat_name {
        /// Array
        values = input(&NUMBER) in values;
        /// Not called as in Modelica
        x as "two words" = input(&NUMBER) in x;
    }
    structured_names {
        /// Array
        values as "motor.'a b'.values" = input(&NUMBER) in values;
        /// Of an array that has no other elements
        x as "axes[2,1].x" = input(&NUMBER) in x;
        /// Second derivative
        y as "der(axes[2,1].x, 2)" = output(&NUMBER) by |toy| toy.x;
    }
    no_such_index {
        /// Scalars in an array
        x = input(&NUMBER) in values[2];
    }
}

#[track_caller]
fn refused<M: Exported>(words: &str) {
    for result in [fmi2::describe::<M>(&Changes::default()), fmi3::describe::<M>(&Changes::default())] {
        let message = format!("{:#}", result.unwrap_err());
        assert!(message.contains(words), "{message}");
    }
}

#[test]
fn names_are_structured() {
    refused::<flat_name::Toy>("'two words' is no name of the structured naming convention");
    let text = fmi2::describe::<structured_names::Toy>(&Changes::default()).unwrap();
    assert!(text.contains(r#"name="motor.&apos;a b&apos;.values[2]""#), "{text}");
}

#[test]
fn places_that_are_not_there() {
    refused::<no_such_index::Toy>("x cannot be read from a new model");
}

#[test]
fn terminals_have_no_arrays() {
    let error = terminals(&common::model::<rod::Rod>(), &[Terminal::plug("heat").signal("T", "T[1]")], &[])
        .unwrap_err();
    assert!(format!("{error:#}").contains("T[1], an element of an array"), "{error:#}");
}
