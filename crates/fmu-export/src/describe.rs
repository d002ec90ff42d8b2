//! Description of a model as JSON. `fmu-package`, which builds FMUs, loads the library and requests it.
//!
//! Floating-point numbers, and the limits of integer types, are written as strings, so that they keep all digits. The
//! functions are not inlined and take trait objects, because they run only once, but their code is in every library
//! and should be small.

use crate::boundary::{forget_panic, panic_message, string};
use crate::capabilities::Events;
use crate::export::Exported;
use crate::info::Info;
use crate::model::Setup;
use crate::stamp::{new_model, stamp};
use crate::types::{Attributes, Type};
use crate::units::Unit;
use crate::variable::Variable;
use fmi_abi::Interface;
use fmi_abi::c_types::{c_char, c_void};
use std::fmt::{Debug, Display, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Version of the format of the description.
const VERSION: u32 = 1;

/// Function that receives a UTF-8 string, such as the description, with its length in bytes.
#[doc(hidden)]
pub type Receive = unsafe extern "C" fn(context: *mut c_void, json: *const u8, length: usize);

/// Passes the description of a model to `receive`, or an empty string after a panic that the description cannot
/// contain. The model may read the files in the directory `resources`.
///
/// # Safety
/// `receive` may be called with this context, and `resources` is NULL or a NUL-terminated string.
#[doc(hidden)]
pub unsafe fn pass_description<M: Exported>(
    resources: *const c_char,
    receive: Receive,
    context: *mut c_void,
) {
    // SAFETY: the caller guarantees a string or NULL.
    let resources = unsafe { string(resources) }.map(|path| path.to_string_lossy().into_owned());
    let json = catch_unwind(|| describe_with::<M>(resources.as_ref())).unwrap_or_else(|panic| {
        forget_panic(Err(panic));
        String::new()
    });
    // SAFETY: the caller guarantees that `receive` accepts `context`; pointer and length come from one
    // string.
    unsafe { receive(context, json.as_ptr(), json.len()) }
}

/// From now on, passes the location and the message of each panic to `receive`, instead of printing them.
///
/// # Safety
/// `receive` may be called with this context at any time, from any thread.
#[doc(hidden)]
pub unsafe fn pass_panics(receive: Receive, context: *mut c_void) {
    struct Context(*mut c_void);
    // SAFETY: the caller guarantees that `receive` may be called with the context from any thread.
    unsafe impl Send for Context {}
    // SAFETY: as above.
    unsafe impl Sync for Context {}
    let context = Context(context);
    std::panic::set_hook(Box::new(move |panic| {
        let Context(context) = &context;
        let message = panic_message(panic.payload());
        let text = match panic.location() {
            Some(place) => format!("{place}: {message}"),
            None => message.to_owned(),
        };
        // SAFETY: the caller guarantees that `receive` accepts `context`; pointer and length come from one string.
        unsafe { receive(*context, text.as_ptr(), text.len()) }
    }));
}

/// Returns the description of a model in this program, as JSON. The model gets no directory of resources.
pub fn describe<M: Exported>() -> String {
    describe_with::<M>(None)
}

fn describe_with<M: Exported>(resources: Option<&String>) -> String {
    let mut json = Json::default();
    json.open("", '{');
    json.word("version", &VERSION);
    info(&mut json, &M::INFO);
    json.string("guid", stamp::<M>().guid());
    json.word("arrays", &M::ARRAYS);
    if let Some(offer) = M::CO_SIMULATION {
        json.open("coSimulation", '{');
        json.word("variableStepSize", &offer.variable_step_size);
        json.word("eventMode", &!matches!(offer.events, Events::None));
        json.word("endsEarly", &offer.ends_early);
        json.close('}');
    }
    if let Some(offer) = M::MODEL_EXCHANGE {
        json.open("modelExchange", '{');
        json.word("indicators", &offer.indicators);
        json.word("stepCompleted", &offer.step_completed);
        json.close('}');
    }
    json.word("partials", &M::PARTIALS);
    json.word("inputDerivatives", &M::INPUT_DERIVATIVES);
    json.word("outputDerivatives", &M::OUTPUT_DERIVATIVES);
    json.open("states", '[');
    M::STATES.iter().for_each(|of| json.words("", [of.state, of.derivative]));
    json.close(']');
    json.open("variables", '[');
    M::TABLE.iter().for_each(|of| variable(&mut json, of));
    json.close(']');
    json.open("starts", '[');
    let co_simulation = M::CO_SIMULATION.map(|_| Interface::CoSimulation);
    let model_exchange = M::MODEL_EXCHANGE.map(|_| Interface::ModelExchange);
    for interface in [co_simulation, model_exchange].into_iter().flatten() {
        let setup = Setup { resource_location: resources.cloned(), ..Setup::new(interface) };
        starts::<M>(&mut json, &setup);
    }
    json.close(']');
    json.close('}');
    json.0
}

#[inline(never)]
fn info(json: &mut Json, of: &Info) {
    json.string("name", of.name);
    json.string("identifier", of.identifier);
    json.string("description", of.description);
    json.string("author", of.author);
    json.string("modelVersion", of.version);
    json.string("license", of.license);
    json.string("copyright", of.copyright);
    json.number("startTime", &of.default_experiment.start_time);
    json.number("stopTime", &of.default_experiment.stop_time);
    json.number("stepSize", &of.default_experiment.step_size);
    json.number("tolerance", &of.default_experiment.tolerance);
    json.word("smooth", &of.smooth);
}

fn variable<M: Exported>(json: &mut Json, of: &Variable<M>) {
    json.open("", '{');
    json.string("name", of.name());
    json.string("array", of.name_of_array());
    json.words("dimensions", of.dimensions());
    json.word("element", &of.element());
    json.string("description", of.description());
    json.number("causality", &format_args!("{}", of.causality()));
    json.number("variability", &format_args!("{}", of.variability()));
    if let Some(initial) = of.initial() {
        json.number("initial", &format_args!("{initial}"));
    }
    variable_type(json, of.variable_type());
    if let Some(differentiated) = of.differentiates() {
        json.word("differentiates", &differentiated);
    }
    if let Some(known) = of.dependencies() {
        json.words("dependencies", known);
        json.word("dependsOnTime", &(of.depends_on_time() == Some(true)));
    }
    json.word("state", &of.is_state());
    json.word("reinit", &of.is_reinit());
    json.close('}');
}

#[inline(never)]
fn variable_type(json: &mut Json, of: &Type) {
    json.open("type", '{');
    json.string("name", of.name);
    json.number("base", &of.base());
    match of.attributes {
        Attributes::Real { quantity, unit: of, min, max, nominal } => {
            json.string("quantity", quantity);
            unit(json, of);
            for (name, value) in [("min", min), ("max", max), ("nominal", nominal)] {
                if let Some(value) = value {
                    json.number(name, &value);
                }
            }
        }
        Attributes::Integer { min, max } => {
            json.number("smallest", &min);
            json.number("largest", &max);
        }
        Attributes::Binary { mime_type, max_size } => {
            json.string("mimeType", mime_type);
            json.word("maxSize", &max_size);
        }
        Attributes::Enumeration(items) => {
            json.open("items", '[');
            for item in items {
                json.open("", '{');
                json.string("name", item.name);
                json.word("value", &item.value);
                json.string("description", item.description);
                json.close('}');
            }
            json.close(']');
        }
        Attributes::Boolean | Attributes::String => {}
    }
    json.close('}');
}

#[inline(never)]
fn unit(json: &mut Json, of: &Unit) {
    json.open("unit", '{');
    json.string("name", of.name);
    json.words("exponents", of.base.exponents);
    json.number("factor", &of.base.factor);
    json.number("offset", &of.base.offset);
    if let Some(display) = of.display {
        json.open("display", '{');
        json.string("name", display.name);
        json.number("factor", &display.factor);
        json.number("offset", &display.offset);
        json.close('}');
    }
    json.close('}');
}

/// Writes the start values of a new model, or the reason why the model cannot be created. The value is `null` if the
/// variable has no start value, and `false` if reading it panics. For Model Exchange, also writes the number of the
/// first event indicator that the model leaves unwritten.
fn starts<M: Exported>(json: &mut Json, setup: &Setup) {
    json.open("", '{');
    let instantiated = catch_unwind(|| new_model::<M>(setup));
    match instantiated {
        Ok(Ok(model)) => {
            json.open("values", '[');
            for of in M::TABLE {
                match catch_unwind(AssertUnwindSafe(|| of.value(&model))) {
                    Ok(value) => match value.filter(|_| of.has_start()) {
                        Some(value) => json.string("", &value.to_string()),
                        None => json.word("", &"null"),
                    },
                    Err(panic) => {
                        forget_panic(Err(panic));
                        json.word("", &false);
                    }
                }
            }
            json.close(']');
            if setup.interface == Interface::ModelExchange
                && let Ok(Some(number)) = catch_unwind(AssertUnwindSafe(|| forgotten_indicator(model)))
            {
                json.word("forgottenIndicator", &number);
            }
        }
        Ok(Err(error)) => json.number("error", &format_args!("{error}")),
        Err(panic) => {
            json.string("error", panic_message(&*panic));
            forget_panic(Err(panic));
        }
    }
    json.close('}');
}

/// Returns the index of the first event indicator that the model does not overwrite.
fn forgotten_indicator<M: Exported>(mut model: M) -> Option<usize> {
    let count = M::MODEL_EXCHANGE.map_or(0, |offer| offer.indicators);
    model.calculate(0.0);
    let fill = |mark: f64| {
        let mut indicators = vec![mark; count];
        model.exported_indicators(&mut indicators);
        indicators
    };
    fill(1.0).iter().zip(fill(2.0)).position(|(one, two)| (*one, two) == (1.0, 2.0))
}

/// Writer of JSON. Elements of an array are written with an empty name.
#[derive(Default)]
struct Json(String);

impl Json {
    #[inline(never)]
    fn begin(&mut self, name: &str) {
        if !matches!(self.0.as_bytes().last(), None | Some(b'{' | b'[')) {
            self.0.push(',');
        }
        if !name.is_empty() {
            self.quoted(name);
            self.0.push(':');
        }
    }

    #[inline(never)]
    fn open(&mut self, name: &str, bracket: char) {
        self.begin(name);
        self.0.push(bracket);
    }

    fn close(&mut self, bracket: char) {
        self.0.push(bracket);
    }

    #[inline(never)]
    fn quoted(&mut self, value: &str) {
        self.0.push('"');
        for letter in value.chars() {
            match letter {
                '"' | '\\' => self.0.extend(['\\', letter]),
                '\0'..='\x1f' => self.formatted(format_args!("\\u{:04x}", u32::from(letter))),
                _ => self.0.push(letter),
            }
        }
        self.0.push('"');
    }

    #[inline(never)]
    fn string(&mut self, name: &str, value: &str) {
        self.begin(name);
        self.quoted(value);
    }

    /// Writes a value as a string, in its `Debug` format, in which a number has all its digits.
    #[inline(never)]
    fn number(&mut self, name: &str, value: &dyn Debug) {
        self.string(name, &format!("{value:?}"));
    }

    /// Writes a value without quotation marks: a number, true, false or null.
    #[inline(never)]
    fn word(&mut self, name: &str, word: &dyn Display) {
        self.begin(name);
        self.formatted(format_args!("{word}"));
    }

    fn words(&mut self, name: &str, words: impl IntoIterator<Item = impl Display>) {
        self.open(name, '[');
        words.into_iter().for_each(|word| self.word("", &word));
        self.close(']');
    }

    #[inline(never)]
    fn formatted(&mut self, value: std::fmt::Arguments<'_>) {
        // Writing to a string does not fail.
        let _ = self.0.write_fmt(value);
    }
}

#[cfg(test)]
mod tests {
    use super::Json;

    #[test]
    fn strings_and_lists_are_json() {
        let mut json = Json::default();
        json.open("", '{');
        json.string("a", "\"\\\n\u{e9}");
        json.words("b", [1, 2]);
        json.number("c", &1e300);
        json.open("d", '[');
        json.word("", &"null");
        json.words("", [0; 0]);
        json.close(']');
        json.close('}');
        assert_eq!(json.0, "{\"a\":\"\\\"\\\\\\u000a\u{e9}\",\"b\":[1,2],\"c\":\"1e300\",\"d\":[null,[]]}");
    }
}
