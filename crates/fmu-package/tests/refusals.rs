//! Models that make no sense are refused by name; what the compiler refuses already is tested in fmu-export.

mod common;

use common::fmi2::describe;
use fmu_export::*;
use fmu_package::Changes;

const SHARE: Type = Type::real("Share", &units::ONE).min(0.0).max(1.0);
const ABOVE: Type = Type::real("Above", &units::ONE).min(3.0);
const EMPTY: Type = Type::real("Empty", &units::ONE).min(2.0).max(1.0);
const NO_NUMBER: Type = Type::real("NoNumber", &units::ONE).max(f64::NAN);
const NO_SIZE: Type = Type::real("NoSize", &units::ONE).nominal(0.0);
const TWO_LINES: Type = Type::real("Two\nLines", &units::ONE);
const OTHER_NUMBER: Type = Type::real("Number", &units::ONE).min(0.0);
const COUNT: Type = Type::integer("Count").min_integer(1).max_integer(3);
const NO_COUNT: Type = Type::integer("NoCount").min_integer(2).max_integer(1);

const INVISIBLE: Unit = Unit::new("m").m(1).display("km", 0.0, 0.0);
const NOTHING: Unit = Unit::new("m").m(1).factor(0.0);
const FAR: Unit = Unit::new("m").m(1).offset(f64::INFINITY);
const NAMELESS: Unit = Unit::new("");
const OTHER_ONE: Unit = Unit::new("1").rad(1);
const OF_INVISIBLE: Type = Type::real("Length", &INVISIBLE);
const OF_NOTHING: Type = Type::real("Length", &NOTHING);
const OF_FAR: Type = Type::real("Length", &FAR);
const OF_NAMELESS: Type = Type::real("Length", &NAMELESS);
const OF_OTHER_ONE: Type = Type::real("Length", &OTHER_ONE);

enumeration! {
    /// Two values.
    pub enum Gear {
        /// None
        Neutral = 0,
        /// Forward
        Drive = 1,
    }
}

const GEAR: &[Item] = <Gear as Enumeration>::ITEMS;
const NEUTRAL: Item = GEAR[0];
const DRIVE: Item = GEAR[1];
const SPORT: Item = Item { name: "Sport", ..DRIVE };
const UNNAMED: Type = Type::enumeration("", GEAR);
const NO_ITEMS: Type = Type::enumeration("Gear", &[]);
const HALF: Type = Type::enumeration("Gear", &[NEUTRAL]);
const TWICE: Type = Type::enumeration("Gear", &[DRIVE, DRIVE]);
const SAME: Type = Type::enumeration("Gear", &[DRIVE, SPORT]);

/// A value of every kind that somebody may stumble over.
#[derive(Clone)]
pub struct Values {
    half: f64,
    much: f64,
    below: f64,
    nan: f64,
    one: i32,
    four: i32,
    text: String,
    drive: Gear,
}

const VALUES: Values = Values {
    half: 0.5,
    much: 1.5,
    below: -0.5,
    nan: f64::NAN,
    one: 1,
    four: 4,
    text: String::new(),
    drive: Gear::Drive,
};

/// The variables of a case: any, one that is told by its type and value, or an input that is all right.
macro_rules! table {
    ({}) => { table! { { u = input(&NUMBER) in v.half; } } };
    ({ $name:ident = $kind:ident(&$of:ident) in v.$field:ident; }) => {
        variables! { for Toy;
            /// The only one
            $name = $kind(&$of) in v.$field;
        }
    };
    ({ $($table:tt)+ }) => { variables! { for Toy; $($table)+ } };
}

/// Each case: what is said of it, which facts are not as usual, its variables.
macro_rules! cases {
    ($(
        $case:ident $message:literal [ $($fact:ident: $value:expr),* ] $table:tt
    )+) => {
        $(
            mod $case {
                use super::*;

                #[derive(Clone)]
                pub struct Toy {
                    v: Values,
                }

                table! { $table }

                impl Model for Toy {
                    const INFO: Info = Info { $( $fact: $value, )* ..Info::new("Toy", "toy", "{toy}") };

                    fn new(_: &Setup) -> Result<Self, Error> {
                        Ok(Self { v: VALUES })
                    }
                }

                impl CoSimulation for Toy {
                    fn step(&mut self, _: Step) -> Result<Stepped, Error> {
                        Ok(Stepped::Done)
                    }
                }

                offer!(Toy: CoSimulation);
            }
        )+

        #[test]
        fn what_makes_no_sense_is_named() {
            $( refused::<$case::Toy>($message); )+
        }
    };
}

/// Neither panics; the structure does without definitions of types and units.
#[track_caller]
fn refused<M: Exported>(message: &str) {
    assert_eq!(format!("{:#}", describe::<M>(&Changes::default()).expect_err(message)), message);
    if let Err(error) = common::structure::<M>(false) {
        assert_eq!(format!("{error:#}"), message);
    }
}

const USUAL: DefaultExperiment = Info::new("", "", "").default_experiment;

cases! {
    // Start values
    above_max "the start value of u must be <= 1, it is 1.5" [] { u = input(&SHARE) in v.much; }
    below_min "the start value of u must be >= 0, it is -0.5" [] { u = input(&SHARE) in v.below; }
    not_finite "the start value of u must be a finite number, it is NaN" [] { u = input(&NUMBER) in v.nan; }
    constant "the start value of y must be <= 1, it is 1.5" [] {
        /// Y
        y = output(&SHARE).constant() by |toy| toy.v.much;
    }
    integer "the start value of n must be between 1 and 3, it is 4" [] { n = parameter(&COUNT) in v.four; }
    unknown_item "the start value of gear must be one of 0 (Neutral), it is 1"
        [] { gear = parameter(&HALF) in v.drive; }

    // Types and units
    empty "u cannot have the type Empty: its range is empty: min 2 is above max 1"
        [] { u = input(&EMPTY) in v.half; }
    no_number "u cannot have the type NoNumber: max must be a finite number"
        [] { u = input(&NO_NUMBER) in v.half; }
    no_size "u cannot have the type NoSize: the nominal value must be > 0, it is 0"
        [] { u = input(&NO_SIZE) in v.half; }
    two_lines "u cannot have the type Two\\nLines: its name is more than one line"
        [] { u = input(&TWO_LINES) in v.half; }
    no_count "n cannot have the type NoCount: its range is empty: min 2 is above max 1"
        [] { n = parameter(&NO_COUNT) in v.one; }
    invisible "u cannot have the type Length: the factor of the display unit km must be finite and not 0, it is 0"
        [] { u = input(&OF_INVISIBLE) in v.half; }
    of_nothing "u cannot have the type Length: the factor of the unit m must be finite and not 0, it is 0"
        [] { u = input(&OF_NOTHING) in v.half; }
    far "u cannot have the type Length: the offset of the unit m must be finite, it is inf"
        [] { u = input(&OF_FAR) in v.half; }
    nameless "u cannot have the type Length: the name '' of its unit is empty or more than one line"
        [] { u = input(&OF_NAMELESS) in v.half; }
    unnamed "gear cannot have its type: an Enumeration needs a name (section 2.2.7)"
        [] { gear = parameter(&UNNAMED) in v.drive; }
    no_items "gear cannot have the type Gear: it has no items" [] { gear = parameter(&NO_ITEMS) in v.drive; }
    twice "gear cannot have the type Gear: it has two items with the name Drive"
        [] { gear = parameter(&TWICE) in v.drive; }
    same "gear cannot have the type Gear: it has two items with the value 1"
        [] { gear = parameter(&SAME) in v.drive; }

    // Names and facts
    no_identifier "the identifier '' must be one of C: letters, digits and underscores, no digit first"
        [identifier: ""] {}
    digit_first "the identifier '7up' must be one of C: letters, digits and underscores, no digit first"
        [identifier: "7up"] {}
    space "the identifier 'my model' must be one of C: letters, digits and underscores, no digit first"
        [identifier: "my model"] {}
    slash "the identifier 'a/b' must be one of C: letters, digits and underscores, no digit first"
        [identifier: "a/b"] {}
    accent "the identifier 'naïve' must be one of C: letters, digits and underscores, no digit first"
        [identifier: "naïve"] {}
    no_name "the model's name '' is empty or more than one line" [name: ""] {}
    no_guid "Toy has no guid" [guid: ""] {}
    long_author "the author of Toy is more than one line" [author: "A\nB"] {}
    no_step "the step size of the default experiment must be > 0, it is 0"
        [default_experiment: DefaultExperiment { step_size: 0.0, ..USUAL }] {}
    no_end "the stop time of the default experiment must be finite, it is inf"
        [default_experiment: DefaultExperiment { stop_time: f64::INFINITY, ..USUAL }] {}
    backwards "the default experiment ends at 1, before its start at 2"
        [default_experiment: DefaultExperiment { start_time: 2.0, ..USUAL }] {}
    empty_name "the variable name '' is empty or more than one line" [] {
        /// U
        u as "" = input(&NUMBER) in v.half;
    }
    long_name "the variable name 'a\\nb' is empty or more than one line" [] {
        /// U
        u as "a\nb" = input(&NUMBER) in v.half;
    }
    long_description "the description of u is more than one line" [] {
        #[doc = "a\nb"]
        u = input(&NUMBER) in v.half;
    }
    two_types "there are two different types with the name Number" [] {
        /// U
        u = input(&NUMBER) in v.half;
        /// W
        w = input(&OTHER_NUMBER) in v.half;
    }
    two_units "there are two different units with the name 1" [] {
        /// U
        u = input(&NUMBER) in v.half;
        /// W
        w = input(&OF_OTHER_ONE) in v.half;
    }
    type_and_variable "Number is a variable and a type; rename one of them (section 2.2.3)" [] {
        /// U
        u as "Number" = input(&NUMBER) in v.half;
    }

    // References
    two_times "there are two independent variables (section 2.2.7)" [] {
        /// Time
        t = independent(&TIME);
        /// Time again
        time = independent(&TIME);
        /// U
        u = input(&NUMBER) in v.half;
    }
    two_derivatives "the state x has 2 derivatives among the variables" [] {
        /// X
        x = output(&NUMBER).state() in v.half;
        /// A
        a = output(&NUMBER).derivative_of(x) by |toy| toy.v.half;
        /// B
        b = output(&NUMBER).derivative_of(x) by |toy| toy.v.half;
    }
    own_derivative "y cannot be the derivative of y" [] {
        /// Y
        y = output(&NUMBER).derivative_of(y) by |toy| toy.v.half;
    }
    of_a_count "y cannot be the derivative of n" [] {
        /// N
        n = parameter(&COUNT) in v.one;
        /// Y
        y = output(&NUMBER).derivative_of(n) by |toy| toy.v.half;
    }
    calculated_known "z depends on y, which is calculated or constant; name the inputs, states and parameters that it \
                      follows from" [] {
        /// Y
        y = output(&NUMBER) by |toy| toy.v.half;
        /// Z
        z = output(&NUMBER).depends_on(&[y]) by |toy| toy.v.half;
    }
    named_twice "y names u twice among what it depends on" [] {
        /// U
        u = input(&NUMBER) in v.half;
        /// Y
        y = output(&NUMBER).depends_on(&[u, u]) by |toy| toy.v.half;
    }
}

/// What has no start value needs none that fits.
mod calculated {
    use super::*;

    #[derive(Clone)]
    pub struct Toy {
        v: Values,
    }

    variables! { for Toy;
        /// U
        u = input(&SHARE) in v.half;
        /// Y
        y = output(&ABOVE).depends_on(&[u]) by |toy| toy.v.half;
        /// N
        n = parameter(&COUNT) in v.one;
        /// Text
        text = parameter(&STRING) in v.text;
    }

    impl Model for Toy {
        const INFO: Info = Info::new("Toy", "toy", "{toy}");

        fn new(_: &Setup) -> Result<Self, Error> {
            Ok(Self { v: VALUES })
        }
    }

    impl ModelExchange for Toy {}
    offer!(Toy: ModelExchange);
}

#[test]
fn what_makes_sense_passes() {
    describe::<calculated::Toy>(&Changes::default()).unwrap();
}

/// Models that are made in some odd way.
macro_rules! made {
    ($($case:ident: $new:expr;)+) => { $(
        mod $case {
            use super::*;

            #[derive(Clone)]
            pub struct Toy {
                u: f64,
                text: String,
            }

            variables! { for Toy;
                /// U
                u = input(&NUMBER) in u;
                /// Text
                text = parameter(&STRING) in text;
            }

            impl Model for Toy {
                const INFO: Info = Info::new("Toy", "toy", "{toy}");

                fn new(setup: &Setup) -> Result<Self, Error> {
                    let make: fn(&Setup) -> Result<(f64, &'static str), Error> = $new;
                    let (u, text) = make(setup)?;
                    Ok(Self { u, text: text.into() })
                }

                fn update(&mut self) -> Result<(), Error> {
                    if self.text == "no" { Err(Error::new("no is no")) } else { Ok(()) }
                }
            }

            impl CoSimulation for Toy {
                fn step(&mut self, _: Step) -> Result<Stepped, Error> {
                    Ok(Stepped::Done)
                }
            }

            impl ModelExchange for Toy {}
            offer!(Toy: CoSimulation + ModelExchange);
        }
    )+ };
}

made! {
    two_faced: |setup| Ok((f64::from(setup.interface as u8), ""));
    never: |_| Err(Error::new("it is broken"));
    unwritable: |_| Ok((0.0, "a\u{1}"));
    self_refusing: |_| Ok((0.0, "no"));
}

#[test]
fn models_that_start_in_some_odd_way_are_refused() {
    refused::<two_faced::Toy>("u starts with 1 in Co-Simulation and with 0 in Model Exchange");
    refused::<never::Toy>("the model cannot be made for Co-Simulation: it is broken");
    refused::<unwritable::Toy>("the start value of text has a character that XML has not: \"a\\u{1}\"");
    refused::<self_refusing::Toy>("these start values make no model: no is no");
}

#[test]
fn an_indicator_that_is_never_filled_in_is_refused() {
    #[derive(Clone)]
    pub struct Toy {
        level: f64,
    }

    variables! { for Toy;
        /// U
        u = input(&NUMBER) in level;
    }

    impl Model for Toy {
        const INFO: Info = Info::new("Toy", "toy", "{toy}");

        fn new(_: &Setup) -> Result<Self, Error> {
            Ok(Self { level: 1.0 })
        }
    }

    impl ModelExchange for Toy {
        const INDICATORS: usize = 2;

        fn indicators(&self, indicators: &mut [f64]) {
            indicators[0] = self.level;
        }
    }

    offer!(Toy: ModelExchange);
    refused::<Toy>("Toy: indicators() does not fill in indicator 1");
}
