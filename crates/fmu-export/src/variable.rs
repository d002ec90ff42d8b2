//! Variables: their attributes, and the access to their values in the model.

use crate::saved::StateVisitor;
use crate::settable::settable;
use crate::types::Type;
use crate::value::{Dimensions, Place, Scalar};
use fmi_abi::AllowedStates;
use fmi_abi::BaseType;
use fmi_abi::Value;
use fmi_abi::{Causality, Initial, Standard, Variability};
use std::marker::PhantomData;
use std::mem::MaybeUninit;

/// Number of a line in the table of variables. Authors write the name of the variable instead; see
/// [`variables!`](crate::variables).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Index(#[doc(hidden)] pub u32);

impl Index {
    /// The time, for [`depends_on`](Variable::depends_on). The table need not contain it.
    pub const TIME: Self = Self(u32::MAX);
}

/// A variable of model `M`: an entry of the table that [`variables!`](crate::variables) defines. An array has
/// one entry per element.
pub struct Variable<M> {
    name: &'static str,
    /// For an element of an array, the name of the array; otherwise equal to `name`.
    name_of_line: &'static str,
    /// Number of the line in the table.
    pub(crate) line: u32,
    /// Number of the element in its array, counted from 0; 0 for a scalar.
    element: u32,
    dimensions: Dimensions,
    description: &'static str,
    causality: Causality,
    variability: Variability,
    initial: Option<Initial>,
    of: &'static Type,
    /// Base type of `of`; a copy for speed.
    base: BaseType,
    /// In a line, the number of the state's line; in an entry of the table, the index of the state.
    derivative_of: Option<Index>,
    pub(crate) depends_on: Option<&'static [Index]>,
    state: bool,
    reinit: bool,
    /// Modes in which the importer may set this variable; derived from the other fields.
    pub(crate) settable: AllowedStates,
    /// Modes in which setting this variable stores any finite value without further checks; none for a parameter, or
    /// for a variable that is not a Real.
    pub(crate) takes_reals: AllowedStates,
    /// Modes in which setting a Real only writes the field and the `bool` after `then`, once the model has started.
    pub(crate) takes_fast: AllowedStates,
    /// Whether setting the variable has no side effect except on the `bool` after `then`.
    plain: bool,
    pub(crate) read: Option<Read<M>>,
    pub(crate) store: Option<Store<M>>,
    /// A fault that a method has found; [`fault`](Self::fault) reports it when the line is complete.
    rejected: Option<&'static str>,
}

impl<M> Clone for Variable<M> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<M> Copy for Variable<M> {}

macro_rules! functions {
    ($($(#[$about:meta])* $name:ident { $($field:ident: $type:ty),+ })+) => {
        $(
            $(#[$about])*
            #[doc(hidden)]
            pub struct $name<M> {
                $(pub $field: $type),+
            }

            impl<M> Clone for $name<M> {
                fn clone(&self) -> Self {
                    *self
                }
            }

            impl<M> Copy for $name<M> {}
        )+
    };
}

functions! {
    /// Functions that read the element with the given number; a scalar is its element 0. `reals` fills a slice with the
    /// elements from this number on, and returns 0 if all values are finite, otherwise NaN. Only arrays have `reals`,
    /// because each function adds to the size of a library.
    Read {
        real: fn(&M, usize) -> f64,
        reals: Option<fn(&M, usize, &mut [MaybeUninit<f64>]) -> f64>,
        value: fn(&M, usize) -> Value
    }

    /// Functions that set the element with the given number. `visit` passes the whole field to a visitor of serialized
    /// states.
    Store {
        real: fn(&mut M, usize, f64),
        value: fn(&mut M, usize, &Value),
        visit: fn(&mut M, &mut dyn StateVisitor)
    }
}

/// Base type and dimensions of a value.
#[doc(hidden)]
#[derive(Clone, Copy)]
pub struct Shape {
    base: BaseType,
    dimensions: Dimensions,
}

impl<M> Variable<M> {
    const fn new(causality: Causality, variability: Variability, of: &'static Type) -> Self {
        Self {
            name: "",
            name_of_line: "",
            line: 0,
            element: 0,
            dimensions: Dimensions::SCALAR,
            description: "",
            causality,
            variability,
            initial: None,
            of,
            base: of.base(),
            derivative_of: None,
            depends_on: None,
            state: false,
            reinit: false,
            settable: AllowedStates::NONE,
            takes_reals: AllowedStates::NONE,
            takes_fast: AllowedStates::NONE,
            plain: false,
            read: None,
            store: None,
            rejected: None,
        }
    }

    /// Creates a variable that is continuous if it is a floating-point number, otherwise discrete.
    const fn moving(causality: Causality, of: &'static Type) -> Self {
        let variability = match of.base() {
            base if base.is_float() => Variability::Continuous,
            _ => Variability::Discrete,
        };
        Self::new(causality, variability, of)
    }

    /// Creates an input; continuous if it is a Real or Float32, otherwise discrete.
    pub const fn input(of: &'static Type) -> Self {
        Self::moving(Causality::Input, of)
    }

    /// Creates an output that the model calculates; continuous if it is a Real or Float32, otherwise discrete.
    pub const fn output(of: &'static Type) -> Self {
        let mut variable = Self::moving(Causality::Output, of);
        variable.initial = Some(Initial::Calculated);
        variable
    }

    /// Creates a local variable that the model calculates; continuous if it is a Real or Float32, otherwise discrete.
    pub const fn local(of: &'static Type) -> Self {
        let mut variable = Self::moving(Causality::Local, of);
        variable.initial = Some(Initial::Calculated);
        variable
    }

    /// Creates a fixed parameter.
    pub const fn parameter(of: &'static Type) -> Self {
        let mut variable = Self::new(Causality::Parameter, Variability::Fixed, of);
        variable.initial = Some(Initial::Exact);
        variable
    }

    /// Creates a calculated parameter: the model calculates it from fixed parameters.
    pub const fn calculated_parameter(of: &'static Type) -> Self {
        let mut variable = Self::new(Causality::CalculatedParameter, Variability::Fixed, of);
        variable.initial = Some(Initial::Calculated);
        variable
    }

    /// Exists only so that the compiler's message explains why there are no clocks.
    #[doc(hidden)]
    pub const fn clock(of: &'static Type) -> Self {
        let mut variable = Self::local(of);
        variable.rejected = Some(
            "clocks and Scheduled Execution are not supported; use events, see ModelExchange::event \
             and CoSimulation::EVENTS",
        );
        variable
    }

    /// Exists only so that the compiler's message explains why there are no structural parameters.
    #[doc(hidden)]
    pub const fn structural_parameter(of: &'static Type) -> Self {
        let mut variable = Self::parameter(of);
        variable.rejected = Some(
            "structural parameters are not supported: an array has the length of its field in Rust, for example 8 in [f64; 8]",
        );
        variable
    }

    /// Creates the independent variable, the time. Its line has neither `in` nor `by`, because its value is the time
    /// of the instance.
    pub const fn independent(of: &'static Type) -> Self {
        Self::new(Causality::Independent, Variability::Continuous, of)
    }

    /// Makes an output or local variable constant.
    #[must_use]
    pub const fn constant(mut self) -> Self {
        self.variability = Variability::Constant;
        self.initial = Some(Initial::Exact);
        self
    }

    /// Makes a local variable fixed: it does not change after the initialization.
    #[must_use]
    pub const fn fixed(mut self) -> Self {
        self.variability = Variability::Fixed;
        self
    }

    /// Makes a parameter tunable, or makes a calculated variable change only with tunable parameters.
    #[must_use]
    pub const fn tunable(mut self) -> Self {
        self.variability = Variability::Tunable;
        self
    }

    /// Makes a continuous variable discrete: it changes only at events or communication points.
    #[must_use]
    pub const fn discrete(mut self) -> Self {
        self.variability = Variability::Discrete;
        self
    }

    /// Makes an output or local variable a continuous-time state. Its start value is exact, unless
    /// [`calculated`](Self::calculated) or [`approx`](Self::approx) follows.
    ///
    /// A state needs a field in the model (`in`). The field contains the value that was set last or that the last step
    /// or event calculated.
    #[must_use]
    pub const fn state(mut self) -> Self {
        self.state = true;
        self.exact()
    }

    /// Marks a state that events may change ([`Event::states_changed`](crate::Event::states_changed)).
    #[must_use]
    pub const fn reinit(mut self) -> Self {
        self.reinit = true;
        self
    }

    /// Gives an output or local variable an exact start value, which the importer may set.
    #[must_use]
    pub const fn exact(mut self) -> Self {
        self.initial = Some(Initial::Exact);
        self
    }

    /// Marks a state whose start value the model calculates. Whenever a value is set,
    /// [`calculate_start`](crate::Model::calculate_start) updates it, until the first step, until the importer sets
    /// states, or until Continuous-Time Mode. An importer that tries to set the start value gets an error, which
    /// names the variables in [`depends_on`](Self::depends_on) as those to set instead.
    #[must_use]
    pub const fn calculated(mut self) -> Self {
        self.initial = Some(Initial::Calculated);
        self
    }

    /// Gives an output or local variable an approximate start value, from which its calculation begins.
    #[must_use]
    pub const fn approx(mut self) -> Self {
        self.initial = Some(Initial::Approx);
        self
    }

    /// Makes an output or local variable the time derivative of another variable. An input cannot be a derivative,
    /// because importers assume that each derivative belongs to a state.
    #[must_use]
    pub const fn derivative_of(mut self, of: Index) -> Self {
        self.derivative_of = Some(of);
        self
    }

    /// Lists all inputs, states, parameters and start values on which an output, a local variable or a calculated
    /// parameter depends. In the table, write `depends_on(u, x)` or `depends_on(&[u, x])`; if it depends on none, write
    /// `depends_on()`.
    ///
    /// The list contains only direct dependencies (section 2.2.8 of FMI 2.0): the variables whose values change the
    /// result at the same instant, or in Initialization Mode. An output that reacts to an input only through a step or
    /// a state does not depend on that input. The time, which FMI 3.0 counts as a known, is [`Index::TIME`]. A variable
    /// without a list is taken to depend on all knowns, unless [`Info::smooth`](crate::Info::smooth) is true.
    #[must_use]
    pub const fn depends_on(mut self, knowns: &'static [Index]) -> Self {
        self.depends_on = Some(knowns);
        self
    }

    /// Sets the functions that access a value in a field of the model. The macro calls it.
    #[doc(hidden)]
    pub const fn stored(mut self, shape: Shape, read: Read<M>, store: Store<M>, plain: bool) -> Self {
        self.plain = plain;
        self.store = Some(store);
        self.read_by(shape, read)
    }

    /// Sets the functions that read a calculated value. The macro calls it.
    #[doc(hidden)]
    pub const fn read_by(mut self, shape: Shape, mut read: Read<M>) -> Self {
        if shape.base as u8 != self.base as u8 {
            self.rejected = Some(wrong_type(self.base));
        } else if self.read.is_some() && !self.dimensions.is(&shape.dimensions) {
            self.rejected = Some("the values of in and by must have equal dimensions");
        }
        self.dimensions = shape.dimensions;
        if self.dimensions.is_scalar() {
            read.reals = None;
        }
        self.read = Some(read);
        self
    }

    /// Sets the name and the description, and derives the modes in which the variable may be set. The macro calls it
    /// last.
    #[doc(hidden)]
    pub const fn finished(mut self, name: &'static str, description: &'static str) -> Self {
        self.name = name;
        self.name_of_line = name;
        self.description = description.trim_ascii();
        let real = matches!(self.of.base(), BaseType::Real);
        self.settable =
            settable(self.causality, self.variability, self.initial, self.state, self.reinit, real);
        if real && !matches!(self.causality, Causality::Parameter) {
            // Excludes the modes in which start values are set, because a rejected start value must be recorded.
            self.takes_reals = self.settable.without(crate::settable::START_VALUE_MODES);
            if self.plain {
                self.takes_fast = self.takes_reals;
            }
        }
        self
    }

    /// Returns the entry of the table for an element of this line; a scalar is its element 0. If the line is a
    /// derivative, `first` is the index of the first element of its state.
    pub(crate) const fn spread(
        &self,
        line: usize,
        element: usize,
        name: &'static str,
        first: Option<usize>,
    ) -> Self {
        let mut variable = *self;
        variable.line = line as u32;
        variable.element = element as u32;
        variable.name = name;
        if let Some(first) = first {
            variable.derivative_of = Some(Index((first + element) as u32));
        }
        variable
    }

    /// Returns the reason why this line is invalid, regardless of other lines; `None` if it is valid.
    pub(crate) const fn fault(&self) -> Option<&'static str> {
        use Causality::*;
        use Variability::*;
        if self.rejected.is_some() {
            return self.rejected;
        }
        if self.description.is_empty() {
            return Some("add a description: a comment (///) above the line");
        }
        if !self.causality.permits(self.variability) {
            return Some("this causality does not permit this variability (section 2.2.7 of FMI 2.0)");
        }
        // What FMI 2.0 permits, FMI 3.0 permits, too.
        if !self.causality.permits_initial(Standard::Fmi2, self.variability, self.initial) {
            return Some(
                "this causality and variability do not permit this initial value (section 2.2.7 of FMI 2.0)",
            );
        }
        let is_real = matches!(self.of.base(), BaseType::Real);
        if matches!(self.variability, Continuous) && !self.of.base().is_float() {
            return Some("only a Real or Float32 can be continuous (section 2.2.7 of FMI 2.0)");
        }
        if self.state && !(matches!(self.variability, Continuous) && is_real) {
            return Some("only a continuous Real can be a state");
        }
        if self.reinit && !self.state {
            return Some("only a state can be changed by events (reinit)");
        }
        let is_calculated = matches!(self.causality, Output | Local);
        if self.derivative_of.is_some()
            && !(is_calculated && matches!(self.variability, Continuous) && is_real)
        {
            return Some("only a continuous Real output or local can be a derivative");
        }
        if self.depends_on.is_some() && !matches!(self.causality, Output | Local | CalculatedParameter) {
            return Some("only calculated variables have dependencies");
        }
        if matches!(self.causality, Independent) && !is_real {
            return Some("the time is a Real");
        }
        match self.read {
            None if !matches!(self.causality, Independent) => {
                return Some("name the field of its value (in ...) or its calculation (by ...)");
            }
            Some(_) if matches!(self.causality, Independent) => {
                return Some("its value is the time: it has neither in nor by");
            }
            _ => {}
        }
        if self.length() == 0 {
            return Some("an array must have at least one element");
        }
        let is_set = self.state
            || matches!(self.causality, Parameter | Input)
            || matches!(self.initial, Some(Initial::Exact | Initial::Approx))
                && !matches!(self.variability, Constant);
        if is_set && self.store.is_none() {
            return Some("importers set it, so it needs a field of the model (in ...)");
        }
        None
    }

    /// Returns the name. An element of an array has indices that count from 1, as in `T[3]`, `T[1,2]`,
    /// `der(T[3])`.
    pub const fn name(&self) -> &'static str {
        self.name
    }

    /// Returns the name without indices: for an element of an array, the name of the array.
    pub const fn name_of_array(&self) -> &'static str {
        self.name_of_line
    }

    /// Returns the sizes of the array to which the element belongs; empty for a scalar.
    pub const fn dimensions(&self) -> &[usize] {
        self.dimensions.sizes()
    }

    /// Returns the number of elements of the array to which the element belongs; 1 for a scalar.
    pub const fn length(&self) -> usize {
        self.dimensions.length()
    }

    /// Returns the number of the element in its array, counted from 0, row by row; 0 for a scalar.
    pub const fn element(&self) -> usize {
        self.element as usize
    }

    pub(crate) const fn has_dimensions(&self, of: &Self) -> bool {
        self.dimensions.is(&of.dimensions)
    }

    /// Returns the description.
    pub const fn description(&self) -> &'static str {
        self.description
    }

    /// Returns the causality.
    pub const fn causality(&self) -> Causality {
        self.causality
    }

    /// Returns the variability.
    pub const fn variability(&self) -> Variability {
        self.variability
    }

    /// Returns the attribute `initial`; `None` for inputs and the time.
    pub const fn initial(&self) -> Option<Initial> {
        self.initial
    }

    /// Returns the type, which contains unit and range.
    pub const fn variable_type(&self) -> &'static Type {
        self.of
    }

    /// Returns the base type.
    #[inline]
    pub const fn base(&self) -> BaseType {
        self.base
    }

    /// Returns the index of the variable of which this one is the time derivative; `None` if it is not a derivative.
    pub const fn differentiates(&self) -> Option<u32> {
        match self.derivative_of {
            Some(Index(of)) => Some(of),
            None => None,
        }
    }

    /// Returns whether [`depends_on`](Self::depends_on) contains [`Index::TIME`]; `None` without
    /// `depends_on`.
    pub fn depends_on_time(&self) -> Option<bool> {
        self.depends_on.map(|knowns| knowns.contains(&Index::TIME))
    }

    /// Returns whether this is a continuous-time state.
    pub const fn is_state(&self) -> bool {
        self.state
    }

    /// Returns whether this is a state that events may change.
    pub const fn is_reinit(&self) -> bool {
        self.reinit
    }

    /// Returns whether the variable has a start value: inputs, and variables with `initial` exact or approx
    /// (section 2.2.7 of FMI 2.0).
    pub const fn has_start(&self) -> bool {
        matches!(
            (self.causality, self.initial),
            (Causality::Input, _) | (_, Some(Initial::Exact | Initial::Approx))
        )
    }

    /// Returns the value in the model; `None` for the time.
    pub fn value(&self, model: &M) -> Option<Value> {
        self.read.map(|read| (read.value)(model, self.element()))
    }

    /// Sets the value in the model without checks. Does nothing for a calculated value.
    pub fn set(&self, model: &mut M, value: &Value) {
        if let Some(store) = &self.store {
            (store.value)(model, self.element(), value);
        }
    }

    /// Passes the value to a visitor if it is a field of the model. The first element of an array passes the
    /// whole array.
    pub(crate) fn visit(&self, model: &mut M, visitor: &mut dyn StateVisitor) {
        if let Some(store) = self.store
            && self.element == 0
        {
            (store.visit)(model, visitor);
        }
    }
}

/// Returns a marker for the type of a field, so that the type can be inferred from a path of fields.
#[doc(hidden)]
pub fn type_of<T>(_: &T) -> PhantomData<T> {
    PhantomData
}

/// Returns the shape of a field of the model.
#[doc(hidden)]
pub const fn shape_of_field<M, T: Place>(_: fn(&M) -> PhantomData<T>) -> Shape {
    Shape { base: T::Element::BASE, dimensions: T::DIMENSIONS }
}

/// Returns the shape of a calculated value.
#[doc(hidden)]
pub const fn shape_of_calculation<M, T: Place>(_: PhantomData<M>, _: fn(&M) -> T) -> Shape {
    Shape { base: T::Element::BASE, dimensions: T::DIMENSIONS }
}

/// Reads the Real with this number in a field: an element of an array, or element 0 of a scalar.
#[doc(hidden)]
#[inline(always)]
pub fn read_real(field: &impl Place, number: usize) -> f64 {
    field.element(number).real()
}

/// Reads the value with this number in a field: an element of an array, or element 0 of a scalar.
#[doc(hidden)]
#[inline(always)]
pub fn read_value(field: &impl Place, number: usize) -> Value {
    field.element(number).value()
}

/// Sets the Real with this number in a field.
#[doc(hidden)]
#[inline(always)]
pub fn set_real(field: &mut impl Place, number: usize, value: f64) {
    field.element_mut(number).set_real(value);
}

/// Sets the value with this number in a field. Ignores a value of another type.
#[doc(hidden)]
#[inline(always)]
pub fn set_value(field: &mut impl Place, number: usize, value: &Value) {
    field.element_mut(number).assign(value);
}

/// Reads consecutive Reals of an array, beginning with the element `first`. Returns 0 if all values are finite,
/// otherwise NaN.
#[doc(hidden)]
pub fn read_reals(array: &impl Place, first: usize, values: &mut [MaybeUninit<f64>]) -> f64 {
    values
        .iter_mut()
        .zip(first..)
        .map(|(value, number)| *value.write(array.element(number).real()) * 0.0)
        .sum()
}

/// Reads a Real of a calculated value; see [`read_real`].
#[doc(hidden)]
#[inline(always)]
pub fn read_real_by<M, T: Place>(model: &M, calculate: fn(&M) -> T, number: usize) -> f64 {
    read_real(&calculate(model), number)
}

/// Reads a calculated value; see [`read_value`].
#[doc(hidden)]
#[inline(always)]
pub fn read_value_by<M, T: Place>(model: &M, calculate: fn(&M) -> T, number: usize) -> Value {
    read_value(&calculate(model), number)
}

/// Reads Reals of a calculated array; see [`read_reals`].
#[doc(hidden)]
#[inline(always)]
pub fn read_reals_by<M, T: Place>(
    model: &M,
    calculate: fn(&M) -> T,
    first: usize,
    values: &mut [MaybeUninit<f64>],
) -> f64 {
    read_reals(&calculate(model), first, values)
}

/// Ends the compilation with a message that contains a variable's name and its fault.
#[doc(hidden)]
#[track_caller]
pub const fn reject(name: &str, fault: &str) -> ! {
    let message =
        ConstString::new().with(b"the variable ").with(name.as_bytes()).with(b": ").with(fault.as_bytes());
    match std::str::from_utf8(message.bytes()) {
        Ok(message) => panic!("{}", message),
        Err(_) => panic!("a name is not UTF-8"),
    }
}

/// Returns the message for a value whose Rust type does not match the type of the variable.
const fn wrong_type(base: BaseType) -> &'static str {
    match base {
        BaseType::Real => "it is a Real, so its value must be an f64",
        BaseType::Float32 => "it is a Float32, so its value must be an f32",
        BaseType::Integer => "it is an Integer, so its value must be an i32",
        BaseType::Int8 => "it is an Int8, so its value must be an i8",
        BaseType::UInt8 => "it is a UInt8, so its value must be a u8",
        BaseType::Int16 => "it is an Int16, so its value must be an i16",
        BaseType::UInt16 => "it is a UInt16, so its value must be a u16",
        BaseType::UInt32 => "it is a UInt32, so its value must be a u32",
        BaseType::Int64 => "it is an Int64, so its value must be an i64",
        BaseType::UInt64 => "it is a UInt64, so its value must be a u64",
        BaseType::Boolean => "it is a Boolean, so its value must be a bool",
        BaseType::String => "it is a String, so its value must be a String",
        BaseType::Binary => "it is a Binary, so its value must be a Vec<u8>",
        BaseType::Enumeration => "it is an Enumeration, so its value must be an enum made by enumeration!",
    }
}

/// A string that is built at compile time: the message about an invalid line.
pub(crate) struct ConstString {
    bytes: [u8; 400],
    length: usize,
}

impl ConstString {
    pub const fn new() -> Self {
        Self { bytes: [0; 400], length: 0 }
    }

    pub const fn with(mut self, text: &[u8]) -> Self {
        let mut index = 0;
        while index < text.len() {
            assert!(self.length < self.bytes.len(), "the name of a variable is too long");
            self.bytes[self.length] = text[index];
            self.length += 1;
            index += 1;
        }
        self
    }

    pub const fn bytes(&self) -> &[u8] {
        self.bytes.split_at(self.length).0
    }
}
