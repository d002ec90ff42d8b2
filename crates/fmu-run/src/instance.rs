//! An instance of a component. Array elements are separate variables here.

use crate::arrays::{ArrayStartValues, Arrays, Expanded};
use crate::description::{Description, Structural};
use crate::error::{Error, request};
use crate::fmu::Loaded;
use crate::library::Library;
use crate::messages::Logging;
use fmi_abi::client::{Rejection, Settings, VariableNames};
use fmi_abi::description::ModelDescription;
use fmi_abi::{Interface, shown_number};
use std::ops::{Deref, DerefMut};
use std::sync::Arc;

/// An instance, freed when dropped. It keeps its library loaded.
#[derive(Debug)]
pub struct Instance {
    // First field, so that it is dropped before the library is unloaded.
    pub(crate) client: fmi_abi::client::Instance,
    _library: Arc<Library>,
    pub(crate) description: Arc<Description>,
    pub(crate) arrays: Arc<Arrays>,
    /// Values of arrays that were set before Initialization Mode; `None` from Initialization Mode on. They are stored because
    /// setting one element passes the whole array, and some FMUs return other values before Initialization Mode.
    pub(crate) array_starts: Option<ArrayStartValues>,
}

/// Times, s, and relative tolerance of an experiment, which are passed to the FMU.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Experiment {
    pub start_time: f64,
    pub stop_time: Option<f64>,
    pub tolerance: Tolerance,
}

/// Fails if the size of a step from this time, s, differs from the first one, for a model that needs steps of equal size. A difference
/// by a rounding error does not matter.
pub(crate) fn check_equal_step(model: &str, first: f64, size: f64, time: f64) -> Result<(), Error> {
    if (size - first).abs() <= 1e-9 * first + 4.0 * f64::EPSILON * time.abs() {
        return Ok(());
    }
    let [first, size, time] = [first, size, time].map(shown_number);
    request(format!(
        "{model} needs steps of equal size (canHandleVariableCommunicationStepSize is not true), but the first step has {first} s and \
        the step from {time} s has {size} s"
    ))
}

/// Relative tolerance of the solvers inside FMUs (section 2.1.6 of FMI 2.0, 2.3.3 of FMI 3.0).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Tolerance {
    /// The tolerance of the default experiment in the model description; if there is none, the FMU chooses.
    #[default]
    Default,
    /// No tolerance: the FMU chooses.
    None,
    /// This tolerance, above 0.
    Value(f64),
}

impl Tolerance {
    /// Fails if a tolerance is given that is not above 0 and finite.
    pub(crate) fn check(self) -> Result<(), Error> {
        match self {
            Self::Value(value) if !(value > 0.0 && value.is_finite()) => {
                request(format!("tolerance is {}; it must be above 0 and finite", shown_number(value)))
            }
            _ => Ok(()),
        }
    }

    /// Returns the tolerance that is passed to an FMU with this model description.
    pub(crate) fn of(self, description: &ModelDescription) -> Option<f64> {
        match self {
            Self::Default => description.default_tolerance,
            Self::None => None,
            Self::Value(value) => Some(value),
        }
    }
}

impl Instance {
    /// Creates an instance of a component for an interface type, in Co-Simulation with event mode or without, and sets structural parameters. The error contains the reason, and
    /// whether the FMU logged no message.
    pub(crate) fn new(
        fmu: &Loaded,
        (index, component): (usize, &str),
        (interface, event_mode): (Interface, bool),
        logging: &Logging,
    ) -> Result<Self, (String, bool)> {
        let library = fmu.library(interface).map_err(|error| (error.to_string(), false))?;
        let settings = Settings {
            name: if component.is_empty() { "instance" } else { component },
            label: component,
            token: &fmu.description.token,
            resources: library.resources.as_deref(),
            logging_on: logging.on,
            event_mode,
            early_return: event_mode,
            listener: logging.listener(index),
            names: Some(Arc::clone(&fmu.description) as Arc<dyn VariableNames>),
            ..Settings::new(interface)
        };
        let client = fmi_abi::client::Instance::new(&library.client, &settings).map_err(|rejection| {
            let no_message = || {
                format!("the instantiation of {} returned NULL without a message", fmu.description.model_name)
            };
            let why = rejection.reason().map_or_else(no_message, |message| message.text.trim().to_owned());
            let prefix = if component.is_empty() { String::new() } else { format!("{component}: ") };
            (prefix + &why, rejection.is_silent())
        })?;
        let (description, array_starts) = (Arc::clone(&fmu.description), Some(ArrayStartValues::default()));
        let arrays = Arc::clone(&description.arrays);
        let mut instance = Self { client, _library: Arc::clone(library), description, arrays, array_starts };
        instance.configure().map_err(|rejection| (rejection.to_string(), rejection.is_silent()))?;
        Ok(instance)
    }

    /// Sets structural parameters (section 2.3.6 of FMI 3.0).
    fn configure(&mut self) -> Result<(), Rejection> {
        if self.description.structure.is_empty() {
            return Ok(());
        }
        self.client.enter_configuration_mode()?;
        for Structural { base, reference, value } in &self.description.structure {
            self.client.set_values(*base, &[*reference], std::slice::from_ref(value))?;
        }
        self.client.exit_configuration_mode()
    }

    pub(crate) fn enter_initialization_mode(
        &mut self,
        start_time: f64,
        stop_time: Option<f64>,
        tolerance: Option<f64>,
    ) -> Result<(), Rejection> {
        self.client.enter_initialization_mode(start_time, stop_time, tolerance)?;
        self.array_starts = None;
        Ok(())
    }

    /// Reads the first time derivatives of outputs.
    pub(crate) fn get_output_derivatives(&mut self, vr: &[u32], values: &mut [f64]) -> Result<(), Rejection> {
        assert_eq!(vr.len(), values.len());
        let Expanded { references, count, indices, .. } = self.arrays.expanded(vr);
        let mut all = vec![0.0; count];
        self.client.get_output_derivatives(&references, &mut all)?;
        indices.iter().zip(values).for_each(|(index, value)| *value = all[*index]);
        Ok(())
    }

    /// Computes directional derivatives of unknowns for a seed (section 2.1.9 of FMI 2.0, 2.2.12 of FMI 3.0).
    pub(crate) fn directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        result: &mut [f64],
    ) -> Result<(), Rejection> {
        assert!(knowns.len() == seed.len() && unknowns.len() == result.len());
        if !self.arrays.among(unknowns) && !self.arrays.among(knowns) {
            return self.client.directional_derivative(unknowns, knowns, seed, result);
        }
        let (unknowns, knowns) = (self.arrays.expanded(unknowns), self.arrays.expanded(knowns));
        // Elements that are not among the knowns have the seed 0.
        let (mut seeds, mut results) = (vec![0.0; knowns.count], vec![0.0; unknowns.count]);
        knowns.indices.iter().zip(seed).for_each(|(index, seed)| seeds[*index] += seed);
        let references = (&unknowns.references, &knowns.references);
        self.client.directional_derivative(references.0, references.1, &seeds, &mut results)?;
        unknowns.indices.iter().zip(result).for_each(|(index, value)| *value = results[*index]);
        Ok(())
    }

    pub(crate) fn reset(&mut self) -> Result<(), Rejection> {
        self.client.reset()?;
        self.array_starts = Some(ArrayStartValues::default());
        self.configure()
    }
}

/// All other functions are called on the instance of `fmi_abi::client`.
impl Deref for Instance {
    type Target = fmi_abi::client::Instance;

    fn deref(&self) -> &fmi_abi::client::Instance {
        &self.client
    }
}

impl DerefMut for Instance {
    fn deref_mut(&mut self) -> &mut fmi_abi::client::Instance {
        &mut self.client
    }
}
