//! [`Exported`], which collects the capabilities of a model in one trait, and [`offer!`](crate::offer), which
//! implements it.

use crate::capabilities::{Event, Events, Step, StepCompleted, Stepped};
use crate::model::{Error, Model};
use fmi_abi::stamp::Stamp;

/// A model with its capabilities. [`offer!`](crate::offer) implements this trait from the capability traits. The
/// functions of missing capabilities have defaults, which this crate never calls.
pub trait Exported: Model {
    /// Capabilities in Co-Simulation; `None` if the model does not support it.
    const CO_SIMULATION: Option<CoSimulationOffer> = None;
    /// Capabilities in Model Exchange; `None` if the model does not support it.
    const MODEL_EXCHANGE: Option<ModelExchangeOffer> = None;
    /// Whether the model has fast paths for its usual steps.
    const FAST_STEPS: bool = false;
    /// Whether the model provides partial derivatives.
    const PARTIALS: bool = false;
    /// Whether the model uses input derivatives.
    const INPUT_DERIVATIVES: bool = false;
    /// Highest order of output derivatives; 0 if there are none.
    const OUTPUT_DERIVATIVES: u32 = 0;

    /// Returns the stamp of the library, in which fmu-package writes the guid.
    #[doc(hidden)]
    fn stamp() -> &'static Stamp;
    #[doc(hidden)]
    fn exported_step(&mut self, _step: Step) -> Result<Stepped, Error> {
        Err(Error::new("this FMU has no Co-Simulation"))
    }
    #[doc(hidden)]
    #[inline]
    fn exported_step_fast(&mut self, _size: f64) -> bool {
        false
    }
    #[doc(hidden)]
    #[inline]
    fn exported_step_any_size(&mut self, _size: f64) -> bool {
        false
    }
    #[doc(hidden)]
    fn exported_indicators(&self, _indicators: &mut [f64]) {}
    #[doc(hidden)]
    fn exported_event(&mut self, _time: f64) -> Result<Event, Error> {
        Ok(Event::default())
    }
    #[doc(hidden)]
    fn exported_continuous_time_entered(&mut self) {}
    #[doc(hidden)]
    fn exported_step_completed(&mut self, _time: f64) -> StepCompleted {
        StepCompleted::default()
    }
    #[doc(hidden)]
    fn exported_nominals(&self, _nominals: &mut [f64]) {}
    #[doc(hidden)]
    fn exported_partials(
        &self,
        _known: Option<(Self::Name, usize)>,
        _initial: bool,
    ) -> impl Fn((Self::Name, usize)) -> Option<f64> {
        |_| None
    }
    #[doc(hidden)]
    fn exported_input_derivative(&mut self, _of: (Self::Name, usize), _order: u32, _value: f64) {}
    #[doc(hidden)]
    fn exported_output_derivative(&self, _of: (Self::Name, usize), _order: u32) -> f64 {
        0.0
    }
}

/// Capabilities in Co-Simulation. All except `atomic_step` are in the model description.
#[derive(Clone, Copy, Debug)]
pub struct CoSimulationOffer {
    /// Whether the step size may vary.
    pub variable_step_size: bool,
    /// Whether steps stop at events.
    pub events: Events,
    /// Whether steps may end early, at events or at other times.
    pub ends_early: bool,
    /// Whether a step checks everything that can fail before it changes the model, so that this crate need not copy
    /// the model to undo a failed step.
    pub atomic_step: bool,
}

impl CoSimulationOffer {
    /// Checks the result of a step. Panics if the step ended in a way that the model does not declare, because
    /// importers rely on the declaration.
    #[doc(hidden)]
    #[inline]
    pub fn check(&self, stepped: &Result<Stepped, Error>) {
        match stepped {
            Ok(Stepped::Done | Stepped::Calculated) | Err(_) => {}
            Ok(Stepped::Event(_)) => assert!(
                self.has_event_mode(),
                "a step stopped at an event (Stepped::Event), but the model does not declare events: add \
                 `const EVENTS: Events = Events::Stop;` to its impl CoSimulation, and handle them in \
                 ModelExchange::event"
            ),
            Ok(Stepped::Early(_) | Stepped::Terminate(_)) => assert!(
                self.ends_early,
                "a step ended early (Stepped::Early or Stepped::Terminate), but the model does not declare that: add \
                 `const ENDS_EARLY: bool = true;` to its impl CoSimulation"
            ),
        }
    }

    /// Returns whether an importer of FMI 3.0 can use Event Mode.
    pub const fn has_event_mode(&self) -> bool {
        !matches!(self.events, Events::None)
    }
}

/// Capabilities in Model Exchange, as in the model description.
#[derive(Clone, Copy, Debug)]
pub struct ModelExchangeOffer {
    /// The number of event indicators.
    pub indicators: usize,
    /// Whether the importer must report each completed step of the integrator.
    pub step_completed: bool,
}

/// Declares the capabilities of a model, without exporting C symbols. Use it for tests, and for libraries with
/// several models. [`export_fmu!`](crate::export_fmu) calls it.
///
/// Compilation fails if the macro names other capabilities than the model implements.
#[macro_export]
macro_rules! offer {
    // `IMPLEMENTED` is true if the model implements the capability: an inherent constant takes precedence over the
    // constant of a trait, but exists only if its bound holds.
    (@must_agree $model:ty, $capability:ident, $($offered:tt)+) => {
        const _: () = {
            struct Is<T>(::core::marker::PhantomData<T>);
            trait Not {
                const IMPLEMENTED: bool = false;
            }
            impl<T> Not for Is<T> {}
            #[allow(dead_code)]
            impl<T: $crate::$capability> Is<T> {
                const IMPLEMENTED: bool = true;
            }
            if <Is<$model>>::IMPLEMENTED && !(<$model as $crate::Exported>::$($offered)+) {
                ::core::panic!(::core::concat!(
                    ::core::stringify!($model), " implements ", ::core::stringify!($capability),
                    ": name it in export_fmu! or offer! as well"
                ));
            }
        };
    };

    (@capability CoSimulation) => {
        const CO_SIMULATION: ::core::option::Option<$crate::CoSimulationOffer> =
            ::core::option::Option::Some($crate::CoSimulationOffer {
                variable_step_size: <Self as $crate::CoSimulation>::VARIABLE_STEP_SIZE,
                events: <Self as $crate::CoSimulation>::EVENTS,
                ends_early: <Self as $crate::CoSimulation>::ENDS_EARLY
                    || !::core::matches!(<Self as $crate::CoSimulation>::EVENTS, $crate::Events::None),
                atomic_step: <Self as $crate::CoSimulation>::ATOMIC_STEP,
            });

        #[inline]
        fn exported_step(&mut self, step: $crate::Step) -> ::core::result::Result<$crate::Stepped, $crate::Error> {
            let stepped = $crate::CoSimulation::step(self, step);
            if let ::core::option::Option::Some(offer) = <Self as $crate::Exported>::CO_SIMULATION {
                offer.check(&stepped);
            }
            stepped
        }
    };
    (@capability FastSteps) => {
        const FAST_STEPS: bool = true;

        #[inline(always)]
        fn exported_step_fast(&mut self, size: f64) -> bool {
            $crate::FastSteps::step_fast(self, size)
        }

        #[inline(always)]
        fn exported_step_any_size(&mut self, size: f64) -> bool {
            $crate::FastSteps::step_any_size(self, size)
        }
    };
    (@capability ModelExchange) => {
        const MODEL_EXCHANGE: ::core::option::Option<$crate::ModelExchangeOffer> =
            ::core::option::Option::Some($crate::ModelExchangeOffer {
                indicators: <Self as $crate::ModelExchange>::INDICATORS,
                step_completed: <Self as $crate::ModelExchange>::STEP_COMPLETED,
            });

        fn exported_indicators(&self, indicators: &mut [f64]) {
            $crate::ModelExchange::indicators(self, indicators);
        }
        fn exported_event(&mut self, time: f64) -> ::core::result::Result<$crate::Event, $crate::Error> {
            $crate::ModelExchange::event(self, time)
        }
        fn exported_continuous_time_entered(&mut self) {
            $crate::ModelExchange::continuous_time_entered(self);
        }
        fn exported_step_completed(&mut self, time: f64) -> $crate::StepCompleted {
            $crate::ModelExchange::step_completed(self, time)
        }
        fn exported_nominals(&self, nominals: &mut [f64]) {
            $crate::ModelExchange::nominals(self, nominals);
        }
    };
    (@capability Partials) => {
        const PARTIALS: bool = true;

        #[inline]
        fn exported_partials(
            &self,
            known: ::core::option::Option<(<Self as $crate::Variables>::Name, usize)>,
            initial: bool,
        ) -> impl ::core::ops::Fn((<Self as $crate::Variables>::Name, usize)) -> ::core::option::Option<f64> {
            $crate::Partials::partials(self, known, initial)
        }
    };
    (@capability InputDerivatives) => {
        const INPUT_DERIVATIVES: bool = true;

        fn exported_input_derivative(
            &mut self,
            (of, element): (<Self as $crate::Variables>::Name, usize),
            order: u32,
            value: f64,
        ) {
            $crate::InputDerivatives::set_element_derivative(self, of, element, order, value);
        }
    };
    (@capability OutputDerivatives) => {
        const OUTPUT_DERIVATIVES: u32 = <Self as $crate::OutputDerivatives>::HIGHEST;

        fn exported_output_derivative(
            &self,
            (of, element): (<Self as $crate::Variables>::Name, usize),
            order: u32,
        ) -> f64 {
            $crate::OutputDerivatives::element_derivative(self, of, element, order)
        }
    };
    (@capability $other:ident) => {
        ::core::compile_error!(::core::concat!(
            ::core::stringify!($other), " is not a capability: there are CoSimulation, FastSteps, ModelExchange, \
             Partials, InputDerivatives and OutputDerivatives"
        ));
    };

    ($model:ty : $first:ident $(+ $next:ident)*) => {
        impl $crate::Exported for $model {
            fn stamp() -> &'static $crate::Stamp {
                static STAMP: $crate::Stamp = $crate::Stamp::new($crate::hash_of_interface::<$model>());
                &STAMP
            }
            $crate::offer! { @capability $first }
            $( $crate::offer! { @capability $next } )*
        }

        const _: () = {
            if let ::core::option::Option::Some(offer) = <$model as $crate::Exported>::CO_SIMULATION {
                ::core::assert!(
                    !offer.has_event_mode() || <$model as $crate::Exported>::MODEL_EXCHANGE.is_some(),
                    "a model with other EVENTS than Events::None needs ModelExchange, because ModelExchange::event handles \
                     the events"
                );
            }
            $crate::offer! { @must_agree $model, CoSimulation, CO_SIMULATION.is_some() }
            $crate::offer! { @must_agree $model, FastSteps, FAST_STEPS }
            $crate::offer! { @must_agree $model, ModelExchange, MODEL_EXCHANGE.is_some() }
            $crate::offer! { @must_agree $model, Partials, PARTIALS }
            $crate::offer! { @must_agree $model, InputDerivatives, INPUT_DERIVATIVES }
            $crate::offer! { @must_agree $model, OutputDerivatives, OUTPUT_DERIVATIVES > 0 }
        };
    };
}
