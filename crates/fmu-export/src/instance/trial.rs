//! An instance without importer and C: a model's own library is not loaded where its FMU is made.

use super::{Importer, Instance, Outcome};
use crate::capabilities::Stepped;
use crate::export::Exported;
use crate::model::{Experiment, Setup};
use crate::value::Value;
use fmi_abi::Interface;

/// An instance that fmu-package tries a model with. What the model refuses is `None`.
#[doc(hidden)]
pub struct Trial<M>(Instance<M>);

/// A state that a trial has saved.
#[doc(hidden)]
#[derive(Clone, Copy)]
pub struct SavedTrial(usize);

impl<M: Exported> Trial<M> {
    fn new(interface: Interface) -> Option<Self> {
        Instance::new(Setup::new(interface), Importer::FMI2, false).ok().map(Self)
    }

    /// As an importer has it before the first step.
    pub fn initialized(interface: Interface, experiment: Experiment) -> Option<Self> {
        let mut trial = Self::new(interface)?;
        let mut initialize = || {
            trial.0.setup_experiment(experiment)?;
            trial.0.enter_initialization_mode()?;
            trial.0.exit_initialization_mode()
        };
        initialize().ok()?;
        Some(trial)
    }

    /// Sets inputs, by their places, with time derivatives or without. In Model Exchange it is an event.
    pub fn set(&mut self, inputs: &[(u32, Value)], derivatives: &[(u32, f64)]) -> Option<()> {
        let mut set = || -> Outcome {
            if self.0.interface() == Interface::ModelExchange {
                self.0.enter_event_mode()?;
            }
            for (place, value) in inputs {
                let base = M::TABLE[*place as usize].base();
                self.0.set(&[*place], &[base], std::iter::once(value.clone()))?;
            }
            let (vr, values): (Vec<u32>, Vec<f64>) = derivatives.iter().copied().unzip();
            if vr.is_empty() {
                Ok(())
            } else {
                self.0.set_input_derivatives(&vr, &vec![1; vr.len()], &values)
            }
        };
        set().ok()
    }

    /// A step, in Model Exchange by Euler's rule with an event at its begin; `None` also if the model ends the simulation.
    pub fn step(&mut self, size: f64) -> Option<()> {
        let time = self.0.state.time;
        match self.0.interface() {
            Interface::CoSimulation => match self.0.step(time, size).ok()? {
                Stepped::Terminate(_) => None,
                _ => Some(()),
            },
            Interface::ModelExchange => {
                self.0.enter_event_mode().ok()?;
                self.0.handle_event().ok()?;
                if self.0.has_ended() {
                    return None;
                }
                self.0.enter_continuous_time_mode();
                let model = self.0.calculated();
                let real = |place: u32| M::TABLE[place as usize].real(model);
                let changed = M::STATES.iter().map(|of| Some(real(of.state)? + size * real(of.derivative)?));
                let states = changed.collect::<Option<Vec<_>>>()?;
                self.0.set_time(time + size).ok()?;
                self.0.set_continuous_states(&states).ok()?;
                self.0.step_completed();
                Some(())
            }
        }
    }

    /// All that can be read: the variables, and for importers that integrate the event indicators and the nominal values of
    /// the states.
    pub fn values(&mut self) -> Vec<Option<Value>> {
        let interface = self.0.interface();
        let model = self.0.calculated();
        let mut values: Vec<_> = M::TABLE.iter().map(|of| of.value(model)).collect();
        if interface == Interface::ModelExchange {
            let mut more = vec![0.0; Instance::<M>::INDICATORS];
            model.exported_indicators(&mut more);
            let of_type = |place: u32| M::TABLE[place as usize].variable_type().nominal_or_one();
            let mut nominals: Vec<f64> = M::STATES.iter().map(|of| of_type(of.state)).collect();
            model.exported_nominals(&mut nominals);
            values.extend(more.into_iter().chain(nominals).map(|value| Some(Value::Real(value))));
        }
        values
    }

    /// Saves the state.
    pub fn save(&mut self) -> Option<SavedTrial> {
        self.0.save(0).ok().map(SavedTrial)
    }

    /// Goes back to a state.
    pub fn restore(&mut self, saved: SavedTrial) -> Option<()> {
        self.0.restore(saved.0).ok()
    }

    /// Another instance that has read the state as bytes.
    ///
    /// # Errors
    /// Why it refuses them. `None` if there are no bytes, or there is no other instance.
    pub fn elsewhere(&mut self, saved: SavedTrial) -> Option<Result<Self, String>> {
        let mut bytes = vec![0; self.0.serialized_size(saved.0).ok()?];
        self.0.serialize(saved.0, &mut bytes).ok()?;
        let mut other = Self::new(self.0.interface())?;
        let read = other.0.deserialize(&bytes, 0).and_then(|handle| other.0.restore(handle));
        Some(read.map(|()| other).map_err(|refusal| refusal.message))
    }
}
