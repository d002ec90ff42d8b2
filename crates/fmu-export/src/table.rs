//! The table of variables: [`variables!`](crate::variables) and what it makes.

use crate::saved::StateVisitor;
use crate::variable::{Variable, refuse};
use std::fmt::Debug;

/// The variables of a model. Implemented by [`variables!`](crate::variables).
pub trait Variables: Sized + 'static {
    /// The names of the variables.
    type Name: Copy + PartialEq + Debug + 'static;

    /// The variables; a variable's place in this list is its value reference.
    const TABLE: &'static [Variable<Self>];

    /// Their names, in the same order.
    const NAMES: &'static [Self::Name];

    /// Places of the states and of their derivatives in the table, by the place of the state.
    #[doc(hidden)]
    const STATES: &'static [StateOfTable];

    /// Shows what the model remembers besides its variables.
    #[doc(hidden)]
    fn visit_memory(&mut self, visitor: &mut dyn StateVisitor);

    /// Shows all that a serialized state holds of the model.
    #[doc(hidden)]
    fn visit_state(&mut self, visitor: &mut dyn StateVisitor) {
        for variable in Self::TABLE {
            variable.visit(self, visitor);
        }
        self.visit_memory(visitor);
    }
}

/// A continuous-time state.
#[doc(hidden)]
#[derive(Clone, Copy, Debug)]
pub struct StateOfTable {
    pub state: u32,
    pub derivative: u32,
}

/// The number of states in a table.
#[doc(hidden)]
pub const fn count_states<M>(table: &[Variable<M>]) -> usize {
    let (mut count, mut place) = (0, 0);
    while place < table.len() {
        count += table[place].is_state() as usize;
        place += 1;
    }
    count
}

/// The states in a table, of which there are `N`.
#[doc(hidden)]
pub const fn find_states<M, const N: usize>(table: &[Variable<M>]) -> [StateOfTable; N] {
    let mut states = [StateOfTable { state: 0, derivative: 0 }; N];
    let (mut found, mut place) = (0, 0);
    while place < table.len() {
        if table[place].is_state() {
            let Some(derivative) = derivative(table, place as u32) else {
                refuse(
                    table[place].name(),
                    "a state needs its derivative in the table: ... = local(...).derivative_of(the state) by ...",
                );
            };
            states[found] = StateOfTable { state: place as u32, derivative };
            found += 1;
        }
        place += 1;
    }
    states
}

const fn derivative<M>(table: &[Variable<M>], state: u32) -> Option<u32> {
    let mut place = 0;
    while place < table.len() {
        if matches!(table[place].differentiates(), Some(of) if of == state) {
            return Some(place as u32);
        }
        place += 1;
    }
    None
}

/// Names are unique (section 2.2.7). The compiler sees to those of the items, not to those that are texts.
#[doc(hidden)]
pub const fn check_names<M>(table: &[Variable<M>]) {
    let mut place = 0;
    while place < table.len() {
        let mut other = 0;
        while other < place {
            if is_equal(table[place].name().as_bytes(), table[other].name().as_bytes()) {
                refuse(table[place].name(), "there are two variables of this name");
            }
            other += 1;
        }
        place += 1;
    }
}

const fn is_equal(one: &[u8], other: &[u8]) -> bool {
    let mut place = 0;
    while place < one.len() && place < other.len() && one[place] == other[place] {
        place += 1;
    }
    place == one.len() && place == other.len()
}

/// Writes a model's table of variables: what each variable is, and where its value lives or how it is calculated.
///
/// ```text
/// variables! { for Model, memory in PLACE, PLACE, ...;      // "memory in" if there is any
///     /// Description that importers show
///     name = KIND(&TYPE).refinement() in PLACE;              // lives in a field of the model
///     name = KIND(&TYPE) in PLACE then |model| { ... };      // and this is done after it was set
///     name = KIND(&TYPE) by |model| ...;                     // is calculated
///     name as "any text" = KIND(&TYPE) in PLACE by |model| ...;  // is set there, and read like this
/// }
/// ```
///
/// A kind is a function of [`Variable`]: `input`, `output`, `local`, `parameter`, `calculated_parameter`,
/// `independent`; a refinement is one of its methods, where other variables are named by their names here. A place
/// is a path of fields, such as `motors[0].theta`. Start values are those of the model that
/// [`Model::new`](crate::Model::new) makes.
///
/// What lives in a place and all that is in the `memory` belongs to a serialized state; see [`Saved`](crate::Saved). What
/// `initialize`, a step or an event changes must be there; `build_fmu` of fmu-package refuses models where something is missing.
///
/// The macro implements [`Variables`] for the model and defines `Name`, an enum with the names of the variables,
/// for [`Partials`](crate::Partials) and its like.
///
/// ```
/// use fmu_export::{NUMBER, variables};
///
/// #[derive(Clone, Default)]
/// pub struct Lag {
///     u: f64,
///     x: f64,
/// }
///
/// variables! { for Lag;
///     /// Input
///     u = input(&NUMBER) in u;
///     /// Output, follows the input
///     x = output(&NUMBER).state() in x;
///     /// Its rate
///     der_x as "der(x)" = local(&NUMBER).derivative_of(x) by |lag| lag.u - lag.x;
/// }
///
/// use fmu_export::Variables;
/// assert_eq!(Lag::TABLE[Name::der_x as usize].name(), "der(x)");
/// assert_eq!(Lag::TABLE[Name::x as usize].description(), "Output, follows the input");
/// ```
#[macro_export]
macro_rules! variables {
    (
        for $model:ty
        $(, memory in $( $memory:ident $([ $memory_at:expr ])* $( . $memory_field:tt $([ $memory_place:expr ])* )* ),+ )? ;
        $(
            $(#[doc = $text:literal])*
            $name:ident $( as $label:literal )? =
                $kind:ident ( $($of:expr),* ) $( . $refinement:ident ( $($argument:expr),* $(,)? ) )*
                $(
                    in $first:ident $([ $at:expr ])* $( . $field:tt $([ $place:expr ])* )*
                    $( then | $changed:ident | $after:block )?
                )?
                $( by $calculate:expr )? ;
        )+
    ) => {
        /// The names of the variables.
        #[allow(non_camel_case_types)]
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u32)]
        pub enum Name {
            $( $(#[doc = $text])* $name ),+
        }

        const _: () = {
            #[allow(non_upper_case_globals, non_camel_case_types, unused)]
            mod index {
                // Not `Name`: a module cannot see the items of a function, where the macro may stand.
                #[repr(u32)]
                enum Place { $( $name ),+ }

                $( pub const $name: $crate::Index = $crate::Index(Place::$name as u32); )+
            }

            impl $crate::Variables for $model {
                type Name = Name;

                const TABLE: &'static [$crate::Variable<Self>] = &[$({
                    let variable = {
                        #[allow(unused_imports)]
                        use index::*;
                        $crate::Variable::<$model>::$kind($($of),*) $( . $refinement($($argument),*) )*
                    };
                    $(
                        let variable = variable.stored(
                            $crate::Read {
                                base: $crate::base_of_place(|model: &$model| {
                                    &model.$first $([$at])* $( .$field $([$place])* )*
                                }),
                                real: |model| $crate::Scalar::real(
                                    &model.$first $([$at])* $( .$field $([$place])* )*
                                ),
                                value: |model| $crate::Scalar::value(
                                    &model.$first $([$at])* $( .$field $([$place])* )*
                                ),
                            },
                            $crate::Store {
                                real: |model, value| {
                                    $crate::Scalar::set_real(
                                        &mut model.$first $([$at])* $( .$field $([$place])* )*,
                                        value,
                                    );
                                    $( { let $changed = model; $after } )?
                                },
                                value: |model, value| {
                                    $crate::Scalar::assign(
                                        &mut model.$first $([$at])* $( .$field $([$place])* )*,
                                        value,
                                    );
                                    $( { let $changed = model; $after } )?
                                },
                                visit: |model, visitor| $crate::Saved::visit(
                                    &mut model.$first $([$at])* $( .$field $([$place])* )*,
                                    visitor,
                                ),
                            },
                        );
                    )?
                    $(
                        let variable = variable.read_by($crate::Read {
                            base: $crate::base_of_calculation(|model: &$model| $crate::read(model, $calculate)),
                            real: |model| $crate::Scalar::real(&$crate::read(model, $calculate)),
                            value: |model| $crate::Scalar::value(&$crate::read(model, $calculate)),
                        });
                    )?
                    variable.finished(
                        $crate::variables!(@label $name $($label)?),
                        ::core::concat!($($text),*),
                    )
                }),+];

                const NAMES: &'static [Name] = &[$(Name::$name),+];

                const STATES: &'static [$crate::StateOfTable] = {
                    const _: () = $crate::check_names(<$model as $crate::Variables>::TABLE);
                    const COUNT: usize = $crate::count_states(<$model as $crate::Variables>::TABLE);
                    const STATES: [$crate::StateOfTable; COUNT] =
                        $crate::find_states(<$model as $crate::Variables>::TABLE);
                    &STATES
                };

                #[allow(unused_variables)]
                fn visit_memory(&mut self, visitor: &mut dyn $crate::StateVisitor) {
                    $($(
                        $crate::Saved::visit(
                            &mut self.$memory $([$memory_at])* $( .$memory_field $([$memory_place])* )*,
                            visitor,
                        );
                    )+)?
                }
            }
        };
    };
    (@label $name:ident) => { ::core::stringify!($name) };
    (@label $name:ident $label:literal) => { $label };
}
