//! The table of variables: [`variables!`](crate::variables), the trait that it implements, and the functions that the
//! generated code calls.

use crate::filling::Filling;
use crate::saved::StateVisitor;
use crate::variable::{Index, Read, Variable, reject};
use std::fmt::Debug;
use std::mem::MaybeUninit;

/// The variables of a model. [`variables!`](crate::variables) implements it.
///
/// # Safety
/// Each offset that a function returns is the offset of a valid value of the stated type in this model, at the time
/// of the call. If a line has no offset, the function returns the argument for that case.
pub unsafe trait Variables: Sized + 'static {
    /// Names of the lines of the table.
    type Name: Copy + PartialEq + Debug + 'static;

    /// `default` of the model, if it implements [`Default`]; [`Model::new`](crate::Model::new) calls it unless the model
    /// has another `new`.
    #[doc(hidden)]
    const START: Option<fn() -> Self>;

    /// The variables, one for each line.
    #[doc(hidden)]
    const LINES: &'static [Variable<Self>];

    /// The variables, with one entry for each element of an array. The index of an entry is its value reference in
    /// FMI 2.0.
    const TABLE: &'static [Variable<Self>];

    /// Names of the lines.
    #[doc(hidden)]
    const NAMES: &'static [Self::Name];

    /// Indices of the states and of their derivatives in the table, sorted by the index of the state.
    #[doc(hidden)]
    const STATES: &'static [StateOfTable];

    /// Whether any variable is an array.
    #[doc(hidden)]
    const ARRAYS: bool = has_arrays(Self::LINES);

    /// Returns the index of a variable in the table; for an array, the index of its first element.
    fn index(name: Self::Name) -> usize {
        let line = Self::NAMES.iter().position(|known| *known == name);
        index_of(Self::LINES, line.expect("the table must have a line for each name"))
    }

    /// Returns the name of the variable at an index of the table, and the number of the element in its array; 0 for a
    /// scalar.
    #[doc(hidden)]
    #[inline]
    fn element(index: u32) -> (Self::Name, usize) {
        if !Self::ARRAYS {
            return (Self::NAMES[index as usize], 0);
        }
        let variable = &Self::TABLE[index as usize];
        (Self::NAMES[variable.line as usize], variable.element())
    }

    /// Returns the offset of the `f64` that is the value of a line, or `without` if reading the line needs a function
    /// call.
    #[doc(hidden)]
    fn offset_to_read(&self, line: Index, without: usize) -> usize;

    /// Returns two offsets: in the lower half, the offset of the `f64` to which setting a line writes; in the upper
    /// half, the offset of the `bool` that then becomes true, or `no_mark` if there is none. Returns `without` if
    /// setting the line needs a function call.
    #[doc(hidden)]
    fn offsets_to_set(&mut self, line: Index, no_mark: usize, without: u64) -> u64;

    /// Visits the values in the model's `memory`, which are not variables.
    #[doc(hidden)]
    fn visit_memory(&mut self, visitor: &mut dyn StateVisitor);

    /// Copies from another model its `memory`, and all values that are in fields after `in`.
    #[doc(hidden)]
    fn copy_values(&mut self, from: &Self);

    /// Visits all values of a serialized state.
    #[doc(hidden)]
    fn visit_state(&mut self, visitor: &mut dyn StateVisitor) {
        for variable in Self::TABLE {
            variable.visit(self, visitor);
        }
        self.visit_memory(visitor);
    }
}

impl<M: Variables> Variable<M> {
    /// Returns the variables in [`depends_on`](Self::depends_on) as indices in the table, except [`Index::TIME`]. An
    /// array is represented by all its elements. Returns `None` for a variable without `depends_on`.
    pub fn dependencies(&self) -> Option<impl Iterator<Item = u32> + use<M>> {
        let indices = |known: &Index| {
            let line = known.0;
            (0..).zip(M::TABLE).filter(move |(_, of)| of.line == line).map(|(index, _)| index)
        };
        self.depends_on.map(|knowns| knowns.iter().flat_map(indices))
    }

    /// Returns the value of a Real; `None` for the time.
    #[inline]
    pub(crate) fn real(&self, model: &M) -> Option<f64> {
        self.read.as_ref().map(|read| (read.real)(model, self.number()))
    }

    /// Fills `values` with elements of the array, beginning with this one, or with the scalar. Returns 0 if all
    /// values are finite, otherwise NaN.
    pub(crate) fn reals(&self, model: &M, time: f64, values: &mut [MaybeUninit<f64>]) -> f64 {
        if let Some(Read { reals: Some(reals), .. }) = self.read {
            return reals(model, self.number(), values);
        }
        values.iter_mut().map(|value| *value.write(self.real(model).unwrap_or(time)) * 0.0).sum()
    }

    #[inline]
    pub(crate) fn set_real(&self, model: &mut M, value: f64) {
        if let Some(store) = &self.store {
            (store.real)(model, self.number(), value);
        }
    }

    /// Returns the number of the element. In models without arrays it is the constant 0, so that the compiler can
    /// simplify the code.
    #[inline(always)]
    fn number(&self) -> usize {
        if M::ARRAYS { self.element() } else { 0 }
    }
}

/// A continuous-time state: its index in the table, and the index of its derivative.
#[doc(hidden)]
#[derive(Clone, Copy, Debug)]
pub struct StateOfTable {
    pub state: u32,
    pub derivative: u32,
}

const fn has_arrays<M>(lines: &[Variable<M>]) -> bool {
    let mut line = 0;
    while line < lines.len() {
        if is_array(&lines[line]) {
            return true;
        }
        line += 1;
    }
    false
}

const fn is_array<M>(variable: &Variable<M>) -> bool {
    !variable.dimensions().is_empty()
}

/// Returns the number of entries of the table before a line.
const fn index_of<M>(lines: &[Variable<M>], line: usize) -> usize {
    let (mut index, mut before) = (0, 0);
    while before < line {
        index += lines[before].length();
        before += 1;
    }
    index
}

/// Returns the number of entries of the table; each element of an array counts.
#[doc(hidden)]
pub const fn count_elements<M>(lines: &[Variable<M>]) -> usize {
    index_of(lines, lines.len())
}

// The compiler interprets the following functions, and takes a microsecond for each call of a generic function. So
// the code that runs for each element of an array contains few calls.

/// Returns the total length in bytes of the names of all array elements.
#[doc(hidden)]
pub const fn count_letters<M>(lines: &[Variable<M>]) -> usize {
    let (mut count, mut line) = (0, 0);
    while line < lines.len() {
        let (sizes, length) = (lines[line].dimensions(), lines[line].length());
        // Each index follows a bracket or a comma, and a bracket follows the last index.
        if !sizes.is_empty() {
            count += length * (lines[line].name_of_array().len() + sizes.len() + 1);
        }
        let mut direction = 0;
        while direction < sizes.len() && length > 0 {
            count += length / sizes[direction] * count_digits_up_to(sizes[direction]);
            direction += 1;
        }
        line += 1;
    }
    count
}

/// Returns the total number of digits of all numbers from 1 to `last`.
const fn count_digits_up_to(last: usize) -> usize {
    let (mut count, mut digits, mut first) = (0, 1, 1);
    while first <= last {
        let end = if last / 10 >= first { first * 10 - 1 } else { last };
        count += digits * (end + 1 - first);
        digits += 1;
        first *= 10;
    }
    count
}

/// Returns the names of all array elements, concatenated.
#[doc(hidden)]
pub const fn write_names<M, const LETTERS: usize>(lines: &[Variable<M>]) -> [u8; LETTERS] {
    let mut letters = [0; LETTERS];
    let (mut at, mut line) = (0, 0);
    while line < lines.len() {
        let (name, sizes) = (lines[line].name_of_array().as_bytes(), lines[line].dimensions());
        let length = if sizes.is_empty() { 0 } else { lines[line].length() };
        let mut element = 0;
        while element < length {
            at = write_name(name, sizes, element, &mut letters, at);
            element += 1;
        }
        line += 1;
    }
    letters
}

/// Writes the name of an array element into `letters`, beginning at `at`: the name of the array with indices that
/// count from 1 (section 2.2.9 of FMI 2.0). In the name of a derivative, the indices follow the name of the variable,
/// as in `der(T[3])`. Returns the index after the last letter.
const fn write_name(
    name: &[u8],
    sizes: &[usize],
    element: usize,
    letters: &mut [u8],
    mut at: usize,
) -> usize {
    let is_derivative = matches!(name, [b'd', b'e', b'r', b'(', ..]);
    let mut letter = 0;
    while letter < name.len() && !(is_derivative && (name[letter] == b',' || name[letter] == b')')) {
        letters[at] = name[letter];
        at += 1;
        letter += 1;
    }
    let mut direction = 0;
    while direction < sizes.len() {
        letters[at] = if direction == 0 { b'[' } else { b',' };
        at += 1;
        let number = index_in(sizes, element, direction);
        let mut unit = 1;
        while number / unit >= 10 {
            unit *= 10;
        }
        while unit > 0 {
            letters[at] = b'0' + (number / unit % 10) as u8;
            at += 1;
            unit /= 10;
        }
        direction += 1;
    }
    letters[at] = b']';
    at += 1;
    while letter < name.len() {
        letters[at] = name[letter];
        at += 1;
        letter += 1;
    }
    at
}

/// Returns the index of an element in one dimension, counted from 1.
const fn index_in(sizes: &[usize], element: usize, direction: usize) -> usize {
    let (mut row, mut inner) = (1, direction + 1);
    while inner < sizes.len() {
        row *= sizes[inner];
        inner += 1;
    }
    element / row % sizes[direction] + 1
}

const fn length_of_name(name: &str, sizes: &[usize], element: usize) -> usize {
    let (mut length, mut direction) = (name.len() + 1, 0);
    while direction < sizes.len() {
        let mut rest = index_in(sizes, element, direction);
        length += 2;
        while rest >= 10 {
            length += 1;
            rest /= 10;
        }
        direction += 1;
    }
    length
}

/// Returns the table of variables. `letters` is the result of [`write_names`]; the names of array elements are slices
/// of it.
#[doc(hidden)]
pub const fn spread<M, const COUNT: usize>(
    lines: &[Variable<M>],
    letters: &'static [u8],
) -> [Variable<M>; COUNT] {
    let Ok(mut letters) = std::str::from_utf8(letters) else { panic!("a name is not UTF-8") };
    let mut table = Filling::new();
    let mut line = 0;
    while line < lines.len() {
        let of = &lines[line];
        let first = match of.differentiates() {
            Some(line) => Some(index_of(lines, line as usize)),
            None => None,
        };
        let (array, sizes, length) = (of.name_of_array(), of.dimensions(), of.length());
        let mut element = 0;
        while element < length {
            let mut name = of.name();
            if !sizes.is_empty() {
                (name, letters) = letters.split_at(length_of_name(array, sizes, element));
            }
            table.push(of.spread(line, element, name, first));
            element += 1;
        }
        line += 1;
    }
    table.filled()
}

/// Returns the number of states; each element of an array counts.
#[doc(hidden)]
pub const fn count_states<M>(lines: &[Variable<M>]) -> usize {
    let (mut count, mut line) = (0, 0);
    while line < lines.len() {
        if lines[line].is_state() {
            count += lines[line].length();
        }
        line += 1;
    }
    count
}

/// Returns the `N` states. Searches for the derivative once for each line, because a search for each element would be
/// slow.
#[doc(hidden)]
pub const fn find_states<M, const N: usize>(lines: &[Variable<M>]) -> [StateOfTable; N] {
    let mut states = [StateOfTable { state: 0, derivative: 0 }; N];
    let (mut found, mut index, mut line) = (0, 0, 0);
    while line < lines.len() {
        // `check_line` rejects a state without derivative.
        if lines[line].is_state()
            && let Some(derivative) = derivative(lines, line as u32)
        {
            let (first, length) = (index_of(lines, derivative as usize), lines[line].length());
            let mut element = 0;
            while element < length {
                states[found] =
                    StateOfTable { state: (index + element) as u32, derivative: (first + element) as u32 };
                found += 1;
                element += 1;
            }
        }
        index += lines[line].length();
        line += 1;
    }
    states
}

/// Returns the number of the line that is the derivative of the line `state`.
const fn derivative<M>(lines: &[Variable<M>], state: u32) -> Option<u32> {
    let mut line = 0;
    while line < lines.len() {
        if matches!(lines[line].differentiates(), Some(of) if of == state) {
            return Some(line as u32);
        }
        line += 1;
    }
    None
}

/// Ends the compilation if a line is invalid. The compiler's message then refers to the line in the author's file.
#[doc(hidden)]
#[track_caller]
pub const fn check_line<M>(lines: &[Variable<M>], Index(line): Index) {
    let of = &lines[line as usize];
    if let Some(fault) = of.fault() {
        reject(of.name(), fault);
    }
    // Names must be unique (section 2.2.7 of FMI 2.0). The compiler checks this only for identifiers, and not for
    // names that are strings.
    let mut other = 0;
    while other < lines.len() {
        if other < line as usize && has_name(of, &lines[other]) || is_element(of, &lines[other]) {
            reject(of.name(), "there are two variables of this name");
        }
        other += 1;
    }
    if of.is_state() && derivative(lines, line).is_none() {
        reject(
            of.name(),
            "a state needs its derivative in the table: ... = local(...).derivative_of(the state) by ...",
        );
    }
    if let Some(differentiated) = of.differentiates()
        && !of.has_dimensions(&lines[differentiated as usize])
    {
        reject(of.name(), "a derivative must have the dimensions of its state");
    }
}

const fn has_name<M>(one: &Variable<M>, other: &Variable<M>) -> bool {
    is_equal(one.name().as_bytes(), other.name().as_bytes())
}

/// Returns whether `one` has the name of an element of `array`.
const fn is_element<M>(one: &Variable<M>, array: &Variable<M>) -> bool {
    let name = one.name().as_bytes();
    let (mut index, mut has_index) = (0, false);
    while index < name.len() {
        has_index |= name[index] == b'[';
        index += 1;
    }
    let mut element = 0;
    while has_index && is_array(array) && element < array.length() {
        let (of, sizes) = (array.name_of_array(), array.dimensions());
        let mut letters = [0; 400];
        if length_of_name(of, sizes, element) == name.len() && name.len() <= letters.len() {
            let length = write_name(of.as_bytes(), sizes, element, &mut letters, 0);
            if is_equal(name, letters.split_at(length).0) {
                return true;
            }
        }
        element += 1;
    }
    false
}

const fn is_equal(one: &[u8], other: &[u8]) -> bool {
    let mut index = 0;
    while index < one.len() && index < other.len() && one[index] == other[index] {
        index += 1;
    }
    index == one.len() && index == other.len()
}

/// Defines a model's struct and its table of variables. Each line contains the name of a variable, its kind, and the field
/// or the calculation of its value.
///
/// ```text
/// variables! {
///     /// Description in the documentation of the crate
///     pub struct Model { field: TYPE = VALUE, ... }, names Name, memory in PLACE, ...;  // only the name is required
///     /// Description that importers show
///     name: TYPE = KIND(&TYPE).refinement().start(VALUE);    // the value is in a field of this name
///     name: TYPE = KIND(&TYPE) then PLACE;                   // setting it also sets a bool to true
///     name: TYPE = KIND(&TYPE) then |model| { ... };         // the block runs after the value was set
///     name: TYPE = KIND(&TYPE) by |model| ...;               // set in the field, but calculated when it is read
///     name = KIND(&TYPE) in PLACE;                           // the value is in another field
///     name = KIND(&TYPE) by |model| ...;                     // the value is calculated when it is read
///     name = KIND(&TYPE) from PLACE;                         // Model::calculate writes the value to a field
///     name as "any text" = KIND(&TYPE) by |model| ...;       // a name that Rust does not allow
/// }
/// ```
///
/// A kind is a function of [`Variable`]: `input`, `output`, `local`, `parameter`, `calculated_parameter`,
/// `independent`. A refinement is one of its methods; its arguments name other variables by their names in the table.
/// A PLACE is a path of fields, such as `motors[0].theta`.
///
/// The macro derives [`Clone`] for the struct and implements [`Default`] with the start values. A field without a start value
/// starts with the default of its type, which is 0 for a number. [`Model::new`](crate::Model::new) is needed only if a start
/// value depends on another one, or on files and other data of the instance.
///
/// With `for Model` instead of `pub struct Model`, the table belongs to a struct that is defined elsewhere. Its lines have a
/// PLACE instead of a TYPE, and the start values are the values in the model that `Model::new` returns.
///
/// Access to a Real is fastest if its place is an `f64` in a path of fields and array elements, and if there is no
/// block after `then`: no function call is needed then. A path through a `Box`, a `Vec` or an implementation of
/// `Index` needs a call.
///
/// If the type of the value is an array, such as `[f64; 8]`, the variable is an array; `[[f64; 2]; 3]` is a matrix,
/// row by row. FMI 3.0 has one variable for an array, but FMI 2.0 has a scalar for each element, `T[1]` to `T[8]`.
/// Start values, ranges and errors refer to single elements, and `then` is carried out after each element is set.
/// `by` returns the whole array; it is calculated only once for elements that are read together. The derivative of an
/// array is an array of the same dimensions. A variable that depends on an array depends on all its elements. If a
/// table contains an array, all its names must follow the structured naming convention (section 2.2.9 of FMI 2.0),
/// for example `motor.current`, `axes[1].angle`, `'any text'`.
///
/// Of the model, a serialized state contains the fields of the variables and the `memory`; see [`Saved`](crate::Saved). List
/// in `memory` all other values that `initialize`, a step or an event changes. `cargo fmu build` rejects models
/// in which such a value is missing.
///
/// The macro implements [`Variables`] for the model. It also defines an enum with the names of the lines, for
/// [`Partials`](crate::Partials) and other capabilities. The enum is called `Name`, unless `names` gives it another
/// name, which is necessary for the second model in a module. [`Variables::index`] returns the index of a name in the
/// table.
///
/// ```
/// use fmu_export::{NUMBER, variables};
///
/// variables! {
///     /// x' = u - x.
///     pub struct Lag;
///     /// Input
///     u: f64 = input(&NUMBER);
///     /// Output, follows the input
///     x: f64 = output(&NUMBER).state().start(0.5);
///     /// Its rate
///     der_x as "der(x)" = local(&NUMBER).derivative_of(x) by |lag| lag.u - lag.x;
/// }
///
/// use fmu_export::Variables;
/// assert_eq!(Lag::TABLE[Lag::index(Name::der_x)].name(), "der(x)");
/// assert_eq!(Lag::TABLE[Lag::index(Name::x)].description(), "Output, follows the input");
/// assert_eq!(Lag::default().x, 0.5);
/// ```
#[macro_export]
macro_rules! variables {
    (
        $(#[$attribute:meta])*
        $visibility:vis struct $model:ident $( {
            $( $(#[$more_attribute:meta])* $more_visibility:vis $more:ident : $more_type:ty $( = $more_start:expr )? ),* $(,)?
        } )?
        $(, names $names:ident )?
        $(, memory in $( $memory:ident $([ $memory_at:expr ])* $( . $memory_field:tt $([ $memory_index:expr ])* )* ),+ )? ;
        $(
            $(#[doc = $text:literal])*
            $name:ident $( as $label:literal )? $( : $type:ty )? =
                $kind:tt $of:tt $( . $refinement:ident $arguments:tt )*
                $( in $first:tt $([ $at:expr ])* $( . $field:tt $([ $index:expr ])* )* )?
                $( then $mark:ident $([ $mark_at:expr ])* $( . $mark_field:tt $([ $mark_index:expr ])* )* )?
                $( then | $changed:ident | $after:block )?
                $( from $from:tt $([ $from_at:expr ])* $( . $from_field:tt $([ $from_index:expr ])* )* )?
                $( by $calculate:expr )? ;
        )+
    ) => {
        // Each list of refinements becomes one token tree, which can be repeated together with the type of the field.
        $crate::variables! {
            @struct [$(#[$attribute])* $visibility] $model
            [$($( [$(#[$more_attribute])* $more_visibility] $more [$more_type] [$( . start ($more_start) )?] )*)?]
            $( $name [$($type)?] [$( . $refinement $arguments )*] )+
        }

        $crate::variables! {
            for $model
            $(, names $names )?
            $(, memory in $( $memory $([ $memory_at ])* $( . $memory_field $([ $memory_index ])* )* ),+ )? ;
            $(
                $(#[doc = $text])*
                $name $( as $label )? =
                    $kind $of $( . $refinement $arguments )*
                    $( in $name : ($type) )?
                    $( in $first $([ $at ])* $( . $field $([ $index ])* )* )?
                    $( then $mark $([ $mark_at ])* $( . $mark_field $([ $mark_index ])* )* )?
                    $( then | $changed | $after )?
                    $( from $from $([ $from_at ])* $( . $from_field $([ $from_index ])* )* )?
                    $( by $calculate )? ;
            )+
        }
    };
    (
        for $model:ty
        $(, names $names:ident )?
        $(, memory in $( $memory:ident $([ $memory_at:expr ])* $( . $memory_field:tt $([ $memory_index:expr ])* )* ),+ )? ;
        $(
            $(#[doc = $text:literal])*
            $name:ident $( as $label:literal )? =
                $kind:tt $of:tt $( . $refinement:ident $arguments:tt )*
                $(
                    in $first:tt $([ $at:expr ])* $( . $field:tt $([ $index:expr ])* )* $( : ($type:ty) )?
                    $( then $mark:ident $([ $mark_at:expr ])* $( . $mark_field:tt $([ $mark_index:expr ])* )* )?
                    $( then | $changed:ident | $after:block )?
                )?
                $( from $from:tt $([ $from_at:expr ])* $( . $from_field:tt $([ $from_index:expr ])* )* )?
                $( by $calculate:expr )? ;
        )+
    ) => {
        $crate::variables! { @names [$($names)?] $( $(#[doc = $text])* $name ),+ }

        const _: () = {
            #[allow(non_upper_case_globals, non_camel_case_types, unused)]
            mod index {
                // A separate enum instead of `Name`: the macro may be called in a function, and this module cannot
                // access items of a function.
                #[repr(u32)]
                enum Place { $( $name ),+ }

                $( pub const $name: $crate::Index = $crate::Index(Place::$name as u32); )+
            }

            $(
                // The function has the name of the kind, for example `input`, so that the compiler's message refers
                // to the author's line: tokens keep their position in the author's file at their first use in a
                // macro.
                #[allow(long_running_const_eval, clippy::needless_borrows_for_generic_args)]
                const _: () = {
                    #[track_caller]
                    const fn $kind<T: ::core::marker::Copy>(_: T) {
                        $crate::check_line(<$model as $crate::Variables>::LINES, index::$name);
                    }
                    $kind $of
                };
            )+

            // SAFETY: the offsets are computed from references to the model's fields at the time of the call.
            unsafe impl $crate::Variables for $model {
                type Name = $crate::variables!(@name $($names)?);

                // An inherent constant takes precedence over the constant of a trait, but exists only if its bound holds.
                const START: ::core::option::Option<fn() -> Self> = {
                    struct Of<T>(::core::marker::PhantomData<T>);
                    trait Without<T> {
                        const START: ::core::option::Option<fn() -> T> = ::core::option::Option::None;
                    }
                    impl<T> Without<T> for Of<T> {}
                    #[allow(dead_code)]
                    impl<T: ::core::default::Default> Of<T> {
                        const START: ::core::option::Option<fn() -> T> =
                            ::core::option::Option::Some(<T as ::core::default::Default>::default);
                    }
                    Of::<Self>::START
                };

                const LINES: &'static [$crate::Variable<Self>] = &[$({
                    let variable = {
                        #[allow(unused_imports)]
                        use index::*;
                        $crate::variables!(
                            @refined [$( $( $type )? )?] [$crate::Variable::<$model>::$kind $of]
                            $( . $refinement $arguments )*
                        )
                    };
                    // Below, each field is bound to a variable of its own name, so that the compiler's messages refer
                    // to the author's line. The empty function hides any constant of this name, because in a `match` a
                    // constant would be compared, and not bound.
                    $( #[allow(dead_code)] fn $first() {} )?
                    $(
                        let variable = variable.stored(
                            match |model: &$model| $crate::type_of(
                                &(*model).$first $([$at])* $( .$field $([$index])* )*
                            ) {
                                $first => $crate::shape_of_field($first),
                            },
                            $crate::Read {
                                real: |model, number| match &(*model).$first $([$at])* $( .$field $([$index])* )* {
                                    $first => $crate::read_real($first, number),
                                },
                                reals: ::core::option::Option::Some(|model, from, values| match &(*model).$first $([$at])* $( .$field $([$index])* )* {
                                    $first => $crate::read_reals($first, from, values),
                                }),
                                value: |model, number| match &(*model).$first $([$at])* $( .$field $([$index])* )* {
                                    $first => $crate::read_value($first, number),
                                },
                            },
                            $crate::Store {
                                real: |model, number, value| {
                                    match &mut (*model).$first $([$at])* $( .$field $([$index])* )* {
                                        $first => $crate::set_real($first, number, value),
                                    }
                                    $( (*model).$mark $([$mark_at])* $( .$mark_field $([$mark_index])* )* = true; )?
                                    $( { let $changed = model; $after } )?
                                },
                                value: |model, number, value| {
                                    match &mut (*model).$first $([$at])* $( .$field $([$index])* )* {
                                        $first => $crate::set_value($first, number, value),
                                    }
                                    $( (*model).$mark $([$mark_at])* $( .$mark_field $([$mark_index])* )* = true; )?
                                    $( { let $changed = model; $after } )?
                                },
                                visit: |model, visitor| match &mut (*model).$first $([$at])* $( .$field $([$index])* )* {
                                    $first => $crate::Saved::visit($first, visitor),
                                },
                            },
                            true $( & $crate::variables!(@instead_of $after false) )?,
                        );
                    )?
                    $(
                        let variable = $crate::variables!(
                            @calculated variable $model,
                            |model: &$model| ::core::clone::Clone::clone(
                                &(*model).$from $([$from_at])* $( .$from_field $([$from_index])* )*
                            )
                        );
                    )?
                    $( let variable = $crate::variables!(@calculated variable $model, $calculate); )?
                    variable.finished(
                        $crate::variables!(@label $name $($label)?),
                        ::core::concat!($($text),*),
                    )
                }),+];

                #[allow(long_running_const_eval)]
                const TABLE: &'static [$crate::Variable<Self>] = {
                    const LINES: &[$crate::Variable<$model>] = <$model as $crate::Variables>::LINES;
                    const LETTERS: &[u8] = &$crate::write_names::<$model, { $crate::count_letters(LINES) }>(LINES);
                    &$crate::spread::<$model, { $crate::count_elements(LINES) }>(LINES, LETTERS)
                };

                const NAMES: &'static [Self::Name] = &[$(<<$model as $crate::Variables>::Name>::$name),+];

                #[allow(long_running_const_eval)]
                const STATES: &'static [$crate::StateOfTable] = {
                    const COUNT: usize = $crate::count_states(<$model as $crate::Variables>::LINES);
                    const STATES: [$crate::StateOfTable; COUNT] =
                        $crate::find_states(<$model as $crate::Variables>::LINES);
                    &STATES
                };

                #[inline(always)]
                fn offset_to_read(&self, line: $crate::Index, without: usize) -> usize {
                    match line {
                        $(index::$name => {
                            let offset = without;
                            $( #[allow(dead_code)] fn $first() {} )?
                            $( #[allow(dead_code)] fn $from() {} )?
                            $( let offset = match &(*self).$first $([$at])* $( .$field $([$index])* )* {
                                $first => $crate::offset_of_real(self, $first, without),
                            }; )?
                            $( let offset = match &(*self).$from $([$from_at])* $( .$from_field $([$from_index])* )* {
                                $from => $crate::offset_of_real(self, $from, without),
                            }; )?
                            $( let offset = $crate::variables!(@instead_of $calculate without); )?
                            offset
                        })+
                        _ => without,
                    }
                }

                #[inline(always)]
                fn offsets_to_set(&mut self, line: $crate::Index, no_mark: usize, without: u64) -> u64 {
                    let model = &raw const *self;
                    match line {
                        $(index::$name => {
                            let offsets = without;
                            $( #[allow(dead_code)] fn $first() {} )?
                            $(
                                let offset = match &mut (*self).$first $([$at])* $( .$field $([$index])* )* {
                                    $first => $crate::offset_of_real(model, $first, usize::MAX),
                                };
                                let mark = no_mark;
                                $(
                                    let mark: &mut bool =
                                        &mut (*self).$mark $([$mark_at])* $( .$mark_field $([$mark_index])* )*;
                                    let mark = $crate::offset_in(model, mark, usize::MAX);
                                )?
                                let offsets = $crate::both_offsets(offset, mark).unwrap_or(without);
                                $( let offsets = $crate::variables!(@instead_of $after without); )?
                            )?
                            offsets
                        })+
                        _ => without,
                    }
                }

                #[allow(unused_variables)]
                fn visit_memory(&mut self, visitor: &mut dyn $crate::StateVisitor) {
                    $($(
                        $crate::Saved::visit(
                            &mut self.$memory $([$memory_at])* $( .$memory_field $([$memory_index])* )*,
                            visitor,
                        );
                    )+)?
                }

                fn copy_values(&mut self, from: &Self) {
                    $($(
                        ::core::clone::Clone::clone_from(
                            &mut self.$memory $([$memory_at])* $( .$memory_field $([$memory_index])* )*,
                            &from.$memory $([$memory_at])* $( .$memory_field $([$memory_index])* )*,
                        );
                    )+)?
                    $($(
                        #[allow(clippy::assigning_clones)]
                        ::core::clone::Clone::clone_from(
                            &mut (*self).$first $([$at])* $( .$field $([$index])* )*,
                            &(*from).$first $([$at])* $( .$field $([$index])* )*,
                        );
                    )?)+
                }
            }
        };
    };
    (
        @struct [$($declaration:tt)*] $model:ident
        [$( [$($more_declaration:tt)*] $more:ident [$more_type:ty] $more_start:tt )*]
        $( $name:ident [$($type:ty)?] $refinements:tt )+
    ) => {
        #[derive(::core::clone::Clone)]
        $($declaration)* struct $model {
            $( $( $name: $type, )? )+
            $( $($more_declaration)* $more: $more_type, )*
        }

        impl ::core::default::Default for $model {
            /// The start values in the table.
            fn default() -> Self {
                Self {
                    $( $( $name: $crate::variables!(@start $type; $refinements), )? )+
                    $( $more: $crate::variables!(@start $more_type; $more_start), )*
                }
            }
        }
    };
    // Two enums called `Name` in a module would cause eight errors, none of which states the remedy, but the name of a module
    // can state it.
    (@names [] $($variants:tt)+) => {
        #[doc(hidden)]
        mod a_second_table_in_a_module_needs_names {
            $crate::variables! { @names [Name] $($variants)+ }
        }
        #[doc(inline)]
        pub use a_second_table_in_a_module_needs_names::Name;
    };
    (@names [$names:ident] $($variants:tt)+) => {
        /// Names of the variables: the identifiers at the start of the lines of `variables!`, which generates this
        /// enum. `names` in `variables!` sets the name of the enum.
        #[allow(non_camel_case_types)]
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u32)]
        pub enum $names {
            $($variants)+
        }
    };
    (@name) => { Name };
    (@name $names:ident) => { $names };
    (@refined $type:tt [$($variable:tt)+]) => { $($variable)+ };
    (@refined $type:tt [$($variable:tt)+] . depends_on ($($known:ident),* $(,)?) $($rest:tt)*) => {
        $crate::variables!(@refined $type [$($variable)+ . depends_on(&[$($known),*])] $($rest)*)
    };
    (@refined [] [$($variable:tt)+] . start $arguments:tt $($rest:tt)*) => {
        ::core::compile_error!(
            "start(...) needs the type of a field, as in `name: f64 = parameter(&NUMBER).start(0.5);` in a table that begins \
             with `struct`; the start values of other fields are in Model::new"
        )
    };
    (@refined $type:tt [$($variable:tt)+] . start $arguments:tt $($rest:tt)*) => {
        $crate::variables!(@refined $type [$($variable)+] $($rest)*)
    };
    (@refined $type:tt [$($variable:tt)+] . $refinement:ident $arguments:tt $($rest:tt)*) => {
        $crate::variables!(@refined $type [$($variable)+ . $refinement $arguments] $($rest)*)
    };
    (@start $type:ty; []) => { <$type as ::core::default::Default>::default() };
    (@start $type:ty; [. start ($start:expr $(,)?) $($rest:tt)*]) => { $start };
    (@start $type:ty; [. $refinement:ident $arguments:tt $($rest:tt)*]) => {
        $crate::variables!(@start $type; [$($rest)*])
    };
    (@instead_of $before:tt $instead:expr) => { $instead };
    (@calculated $variable:ident $model:ty, $calculate:expr) => {
        $variable.read_by(
            $crate::shape_of_calculation(::core::marker::PhantomData::<$model>, $calculate),
            $crate::Read {
                real: |model, number| $crate::read_real_by(model, $calculate, number),
                reals: ::core::option::Option::Some(|model, first, values| {
                    $crate::read_reals_by(model, $calculate, first, values)
                }),
                value: |model, number| $crate::read_value_by(model, $calculate, number),
            },
        )
    };
    (@label $name:ident) => { ::core::stringify!($name) };
    (@label $name:ident $label:literal) => { $label };
}
