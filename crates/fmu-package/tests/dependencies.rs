//! The dependencies of models with branches and memory, where no trying near the start values can find them.

mod common;

use common::fmi2::describe;
use fmu_export::*;
use fmu_package::Changes;
use fmu_package::structure::DependencyKind::Dependent;
use fmu_package::structure::Unknown;

#[derive(Clone, Default)]
struct Branches {
    u: f64,
    v: f64,
    sum: f64,
    gain: f64,
    stepped: bool,
}

impl Branches {
    fn above(&self) -> f64 {
        if self.u > 10.0 { self.u } else { 0.0 }
    }
}

variables! { for Branches, memory in sum, stepped;
    /// Input
    u = input(&NUMBER) in u;
    /// Input
    v = input(&NUMBER) in v;
    /// u where it is above 10, else 0
    above = output(&NUMBER) by |model| model.above();
    /// u within 100, v after the first step
    limited = output(&NUMBER) by |model| model.u.clamp(-100.0, 100.0) + if model.stepped { model.v } else { 0.0 };
    /// The same as above
    declared = output(&NUMBER).depends_on(&[u]) by |model| model.above();
    /// The sum of u at the steps before, times the gain
    sum = output(&NUMBER).depends_on(&[gain]) by |model| model.gain * (1.0 + model.sum);
    /// Factor
    gain = parameter(&NUMBER) in gain;
}

impl Model for Branches {
    const INFO: Info = Info::new("Branches", "branches", "{branches}");

    fn new(_: &Setup) -> Result<Self, Error> {
        Ok(Self { gain: 1.0, ..Self::default() })
    }
}

impl CoSimulation for Branches {
    fn step(&mut self, _: Step) -> Result<Stepped, Error> {
        self.sum += self.u;
        self.stepped = true;
        Ok(Stepped::Done)
    }
}

impl Partials for Branches {
    /// Exact where the model is, and 0 all around the start values.
    fn partial(&self, unknown: Name, known: Name) -> Option<f64> {
        Some(match (unknown, known) {
            (Name::above | Name::declared, Name::u) => f64::from(self.u > 10.0),
            (Name::limited, Name::u) => f64::from(self.u.abs() < 100.0),
            (Name::limited, Name::v) => f64::from(self.stepped),
            (Name::sum, Name::gain) => 1.0 + self.sum,
            _ => 0.0,
        })
    }
}

offer!(Branches: CoSimulation + Partials);

#[test]
fn what_cannot_be_ruled_out_is_listed_and_what_is_declared_narrows_it() {
    let structure = common::structure::<Branches>(false).unwrap();
    let known = |list: Vec<Unknown>| {
        list.into_iter()
            .map(|Unknown { vr, dependencies }| {
                assert!(dependencies.iter().all(|(_, kind)| *kind == Dependent), "{dependencies:?}");
                (vr, dependencies.into_iter().map(|(known, _)| known).collect())
            })
            .collect::<Vec<(u32, Vec<u32>)>>()
    };
    let [u, v, above, limited, declared, sum, gain] = [0, 1, 2, 3, 4, 5, 6];
    assert_eq!(
        known(structure.outputs),
        [(above, vec![u, v]), (limited, vec![u, v]), (declared, vec![u]), (sum, vec![])]
    );
    assert_eq!(
        known(structure.initial_unknowns),
        [(above, vec![u, v, gain]), (limited, vec![u, v, gain]), (declared, vec![u]), (sum, vec![gain])]
    );
}

/// Models that say that their output depends on nothing.
macro_rules! liars {
    ($($name:ident: $smooth:literal;)+) => { $(
        mod $name {
            use super::*;

            #[derive(Clone, Default)]
            pub struct Liar {
                u: f64,
            }

            variables! { for Liar;
                /// Input
                u = input(&NUMBER) in u;
                /// The input
                y = output(&NUMBER).depends_on(&[]) by |liar| liar.u;
            }

            impl Model for Liar {
                const INFO: Info = Info { smooth: $smooth, ..Info::new("Liar", "liar", "{liar}") };

                fn new(_: &Setup) -> Result<Self, Error> {
                    Ok(Self::default())
                }
            }

            impl ModelExchange for Liar {}
            offer!(Liar: ModelExchange);
        }
    )+ };
}

liars! {
    plain: false;
    smooth: true;
}

#[test]
fn a_declaration_that_the_model_contradicts_is_refused() {
    for error in [
        describe::<plain::Liar>(&Changes::default()).unwrap_err(),
        describe::<smooth::Liar>(&Changes::default()).unwrap_err(),
    ] {
        assert_eq!(error.to_string(), "y reacts to u, which its depends_on does not name");
    }
}

/// Models whose derivatives are wrong in one thing: dy/du = 2 u, y = u^2 + time.
macro_rules! derivers {
    ($($name:ident: $partial:expr, $initial:expr, $by_time:expr;)+) => { $(
        mod $name {
            use super::*;

            #[derive(Clone, Default)]
            pub struct Deriver {
                u: f64,
                time: f64,
            }

            variables! { for Deriver;
                /// Input
                u = input(&NUMBER) in u;
                /// Its square, and the time
                y = output(&NUMBER) by |model| model.u * model.u + model.time;
            }

            impl Model for Deriver {
                const INFO: Info = Info::new("Deriver", "deriver", "{deriver}");

                fn new(_: &Setup) -> Result<Self, Error> {
                    Ok(Self::default())
                }

                fn calculate(&mut self, time: f64) {
                    self.time = time;
                }
            }

            impl CoSimulation for Deriver {
                fn step(&mut self, _: Step) -> Result<Stepped, Error> {
                    Ok(Stepped::Done)
                }
            }

            impl Partials for Deriver {
                fn partial(&self, _: Name, _: Name) -> Option<f64> {
                    Some($partial * self.u)
                }

                fn initial_partial(&self, _: Name, _: Name) -> Option<f64> {
                    Some($initial * self.u)
                }

                fn partial_by_time(&self, _: Name) -> Option<f64> {
                    Some($by_time)
                }
            }

            offer!(Deriver: CoSimulation + Partials);
        }
    )+ };
}

derivers! {
    right: 2.0, 2.0, 1.0;
    wrong_partial: 2.001, 2.0, 1.0;
    wrong_initial_partial: 2.0, 0.0, 1.0;
    wrong_by_time: 2.0, 2.0, 0.0;
    no_number: f64::NAN, 2.0, 1.0;
}

#[test]
fn derivatives_that_are_not_those_of_the_values_are_refused() {
    use common::fmi3;
    fmi3::describe::<right::Deriver>(&Changes::default()).unwrap();
    for (described, beginning, function) in [
        (
            fmi3::describe::<wrong_partial::Deriver>(&Changes::default()),
            "of y with respect to u is",
            "Partials::partial,",
        ),
        (
            fmi3::describe::<wrong_initial_partial::Deriver>(&Changes::default()),
            "of y with respect to u in Initialization Mode is",
            "Partials::initial_partial,",
        ),
        (
            fmi3::describe::<wrong_by_time::Deriver>(&Changes::default()),
            "of y with respect to time is",
            "Partials::partial_by_time,",
        ),
        (
            fmi3::describe::<no_number::Deriver>(&Changes::default()),
            "of y with respect to u is NaN",
            "Partials::partial,",
        ),
    ] {
        let message = described.unwrap_err().to_string();
        assert!(
            message.starts_with(&format!("the derivative {beginning}")) && message.contains(function),
            "{message}"
        );
    }
    // Time is no variable here, so FMI 2.0 has no derivatives with respect to it.
    describe::<wrong_by_time::Deriver>(&Changes::default()).unwrap();
}

/// A characteristic: breakpoints that must rise, as interpolation needs them.
macro_rules! characteristic {
    ($module:ident $smooth:literal [$length:literal] $start:expr; $fits:expr) => {
        mod $module {
            use super::*;

            #[derive(Clone)]
            pub struct Table {
                u: f64,
                x: [f64; $length],
            }

            variables! { for Table;
                /// Input
                u = input(&NUMBER) in u;
                /// Breakpoints
                x = parameter(&NUMBER) in x;
                /// Mean of the breakpoints, times the input
                y = output(&NUMBER) by |table| table.u * table.x.iter().sum::<f64>();
            }

            impl Model for Table {
                const INFO: Info = Info { smooth: $smooth, ..Info::new("Table", "table", "{table}") };

                fn new(_: &Setup) -> Result<Self, Error> {
                    Ok(Self { u: 1.0, x: $start })
                }

                fn update(&mut self) -> Result<(), Error> {
                    let fits: fn(&[f64]) -> bool = $fits;
                    if fits(&self.x) { Ok(()) } else { Err(Error::new("the breakpoints do not fit")) }
                }
            }

            impl CoSimulation for Table {
                fn step(&mut self, _: Step) -> Result<Stepped, Error> {
                    Ok(Stepped::Done)
                }
            }

            offer!(Table: CoSimulation);
        }
    };
}

fn rise(x: &[f64]) -> bool {
    x.is_sorted_by(|one, next| one < next)
}

/// Whether the distances are all the same.
fn are_even(x: &[f64]) -> bool {
    x.windows(3).all(|x| (x[2] - 2.0 * x[1] + x[0]).abs() < 1e-9)
}

characteristic! { twelve false [12] std::array::from_fn(|i| 1.0 + i as f64); rise }
characteristic! { twenty true [20] std::array::from_fn(|i| 0.1 * i as f64); rise }
characteristic! { signed true [7] [-1.0, -0.3, -0.1, 0.0, 0.1, 0.3, 1.0]; rise }
characteristic! { close true [4] [500.0, 500.1, 500.15, 501.0]; rise }
characteristic! { even false [5] [0.0, 1.0, 2.0, 3.0, 4.0]; are_even }
characteristic! { smooth_and_even true [5] [0.0, 1.0, 2.0, 3.0, 4.0]; are_even }

/// Every value must fit the others; few of those that are drawn separately do.
#[test]
fn parameters_that_must_rise_are_tried_within_their_order() {
    fn initial<M: Exported>() -> Vec<(u32, fmu_package::structure::DependencyKind)> {
        let structure = common::structure::<M>(false).unwrap();
        common::fmi3::describe::<M>(&Changes::default()).unwrap();
        structure.initial_unknowns[0].dependencies.clone()
    }
    let all = |length: u32| (0..=length).map(|place| (place, Dependent)).collect::<Vec<_>>();
    assert_eq!(initial::<twelve::Table>(), all(12));
    // Of these every single breakpoint was found to act.
    assert_eq!(initial::<twenty::Table>(), all(20));
    assert_eq!(initial::<signed::Table>(), all(7));
    assert_eq!(initial::<close::Table>(), all(4));
    // None of them can change separately, so each may act.
    assert_eq!(initial::<even::Table>(), all(5));
    let message = describe::<smooth_and_even::Table>(&Changes::default()).unwrap_err().to_string();
    for word in [
        "x[1] cannot be tried separately",
        "0.0008 %",
        "the breakpoints do not fit",
        "`smooth`",
        "`depends_on`",
    ] {
        assert!(message.contains(word), "{message}");
    }
}
