//! [`Simulation`] runs a model in the tests of its author.

use crate::export::Exported;
use crate::instance::{Importer, Instance, Rejection};
use crate::model::{Error, Experiment, Setup};
use crate::table::Variables;
use crate::variable::Variable;
use fmi_abi::{BaseType, Interface, Mode, Standard, Status, Value};

/// Simulates a model in this process, for the tests of the model. It makes the calls that an importer makes, either of
/// Co-Simulation or of Model Exchange.
///
/// As in an FMU, every value is checked, and events are handled within a step. Messages are stored; see
/// [`messages`](Self::messages). Model Exchange is integrated with a tolerance of 1e-10, so the results of both
/// interface types differ only by the errors of the model's `step`, unless its equations or events contradict `step`:
///
/// ```
/// # use fmu_export::*;
/// # #[derive(Clone, Default)]
/// # struct Lag { u: f64, x: f64 }
/// # variables! { for Lag;
/// #     /// Input
/// #     u = input(&NUMBER) in u;
/// #     /// Output
/// #     x = output(&NUMBER).state() in x;
/// #     /// Its rate
/// #     der_x as "der(x)" = local(&NUMBER).derivative_of(x) by |lag| lag.u - lag.x;
/// # }
/// # impl Model for Lag {
/// #     const INFO: Info = Info::new("Lag", "lag");
/// #     fn new(_: &Setup) -> Result<Self, Error> { Ok(Self::default()) }
/// # }
/// # impl CoSimulation for Lag {
/// #     fn step(&mut self, step: Step) -> Result<Stepped, Error> {
/// #         self.x += (self.u - self.x) * (1.0 - (-step.size).exp());
/// #         Ok(Stepped::Done)
/// #     }
/// # }
/// # impl ModelExchange for Lag {}
/// # offer!(Lag: CoSimulation + ModelExchange);
/// for interface in [Interface::CoSimulation, Interface::ModelExchange] {
///     let x = Simulation::<Lag>::of(interface)?.set("u", 1.0)?.run(5.0)?.get("x")?;
///     assert!((x - (1.0 - (-5.0_f64).exp())).abs() < 1e-9);
/// }
/// # Ok::<(), Error>(())
/// ```
pub struct Simulation<M> {
    instance: Instance<M>,
    step_size: f64,
}

impl<M: Exported> Simulation<M> {
    /// Creates a simulation in Co-Simulation with the start values of the model. The step size comes from the default
    /// experiment of [`INFO`](crate::Model::INFO).
    ///
    /// # Errors
    /// Fails if the model cannot be created, or does not support Co-Simulation.
    pub fn new() -> Result<Self, Error> {
        Self::of(Interface::CoSimulation)
    }

    /// Creates a simulation of this interface type, as [`new`](Self::new) does for Co-Simulation.
    ///
    /// # Errors
    /// Fails if the model cannot be created, or does not support the interface type.
    pub fn of(interface: Interface) -> Result<Self, Error> {
        Self::with(Setup::new(interface))
    }

    /// Creates a simulation of a model that reads files. `directory` contains the files, for example
    /// `modelDescription/resources` of the package.
    ///
    /// # Errors
    /// Same errors as [`new`](Self::new).
    pub fn with_resources(directory: &str) -> Result<Self, Error> {
        let resource_location = Some(directory.to_owned());
        Self::with(Setup { resource_location, ..Setup::new(Interface::CoSimulation) })
    }

    /// Creates a simulation with this setup, for example of Model Exchange with resources.
    ///
    /// # Errors
    /// Same errors as [`of`](Self::of).
    pub fn with(setup: Setup) -> Result<Self, Error> {
        let importer = Importer { standard: Standard::Fmi3, event_mode: false, early_return: true };
        let instance = Instance::new(setup, importer, true)?;
        Ok(Self { instance, step_size: M::INFO.default_experiment.step_size })
    }

    /// Sets the size of the following steps, s. In Model Exchange, steps of the integration may be shorter.
    pub fn step_size(&mut self, size: f64) -> &mut Self {
        self.step_size = size;
        self
    }

    /// Sets a variable, one element of an array, or all elements of an array to the same value; `name` is for example
    /// `x` or `x[2]`. Set start values before the first call of [`initialize`](Self::initialize) or [`run`](Self::run);
    /// set inputs and parameters at any time.
    ///
    /// # Errors
    /// Fails if there is no such variable, if it cannot be set at this time, or if the value is rejected.
    pub fn set(&mut self, name: &str, value: impl Into<Value>) -> Result<&mut Self, Error> {
        let indices = indices::<M>(name)?;
        let values = vec![value.into(); indices.len()];
        self.set_all(&indices, values)
    }

    /// Sets the elements of an array to these values, row by row.
    ///
    /// # Errors
    /// Fails for the same reasons as [`set`](Self::set), and if the number of values differs from the number of
    /// elements.
    pub fn set_array<V: Into<Value>>(
        &mut self,
        name: &str,
        values: impl IntoIterator<Item = V>,
    ) -> Result<&mut Self, Error> {
        let indices = indices::<M>(name)?;
        let values: Vec<Value> = values.into_iter().map(Into::into).collect();
        if values.len() != indices.len() {
            return Err(Error::new(format!(
                "{name} has {} elements, there are {} values",
                indices.len(),
                values.len()
            )));
        }
        self.set_all(&indices, values)
    }

    fn set_all(&mut self, indices: &[u32], values: Vec<Value>) -> Result<&mut Self, Error> {
        let variable = variable::<M>(indices[0]);
        let kind = |value: &Value| match value {
            Value::Real(_) => matches!(variable.base(), BaseType::Real | BaseType::Float32),
            Value::Boolean(_) => variable.base() == BaseType::Boolean,
            Value::String(_) => variable.base() == BaseType::String,
            Value::Binary(_) => variable.base() == BaseType::Binary,
            Value::Integer(_) => {
                variable.base().range().is_some() || variable.base() == BaseType::Enumeration
            }
        };
        if let Some(value) = values.iter().find(|value| !kind(value)) {
            let (name, base) = (variable.name(), variable.base());
            return Err(Error::new(format!("{name} is of type {base} and cannot be {value:?}")));
        }
        self.instance.set(indices, &[variable.base()], &|index| values[index].clone())?;
        self.instance.listen();
        Ok(self)
    }

    /// Initializes the model, if it is not initialized yet. [`run`](Self::run) calls this function.
    ///
    /// # Errors
    /// Fails if the model cannot start with these values.
    pub fn initialize(&mut self) -> Result<&mut Self, Error> {
        if self.instance.mode() == Mode::Instantiated {
            self.instance.enter_initialization_mode_at(Experiment::default())?;
            self.instance.exit_initialization_mode()?;
            if self.instance.mode() == Mode::Event {
                self.instance.handle_event()?;
            }
            self.instance.listen();
        }
        Ok(self)
    }

    /// Performs steps until this time, s, or until the model ends the simulation; see [`has_ended`](Self::has_ended).
    ///
    /// # Errors
    /// Fails if the model rejects a step.
    pub fn run(&mut self, until: f64) -> Result<&mut Self, Error> {
        self.initialize()?;
        if self.instance.interface() == Interface::ModelExchange {
            self.instance.integrate(until, self.step_size)?;
            self.instance.listen();
            return Ok(self);
        }
        let begin = self.time();
        let steps = ((until - begin) / self.step_size - 1e-9).ceil();
        for step in 1..=steps as u64 {
            let end = if step as f64 == steps { until } else { begin + step as f64 * self.step_size };
            // A step may end early; the next step then begins at that time.
            while self.time() < end && !self.has_ended() {
                let time = self.time();
                self.instance.do_step_to(time, end - time)?;
                self.instance.listen();
            }
        }
        Ok(self)
    }

    /// Returns the current time, s.
    pub fn time(&self) -> f64 {
        self.instance.last_successful_time()
    }

    /// Returns whether the model has ended the simulation.
    pub fn has_ended(&self) -> bool {
        self.instance.has_ended()
    }

    /// Returns the value of a variable; for an array, the value of its first element.
    ///
    /// # Errors
    /// Fails if there is no such variable, or if its value is not finite.
    pub fn value(&mut self, name: &str) -> Result<Value, Error> {
        Ok(self.values(name)?.swap_remove(0))
    }

    /// Returns the value of a variable as a number: 0 or 1 for a Boolean, the number of the item for an Enumeration.
    ///
    /// # Errors
    /// Fails for the same reasons as [`value`](Self::value), and if the variable is a String or a Binary.
    pub fn get(&mut self, name: &str) -> Result<f64, Error> {
        match self.value(name)? {
            Value::Real(value) => Ok(value),
            Value::Integer(value) => Ok(value as f64),
            Value::Boolean(value) => Ok(f64::from(u8::from(value))),
            other => Err(Error::new(format!("{name} is not a number but {other:?}"))),
        }
    }

    /// Returns the values of all elements of an array, row by row.
    ///
    /// # Errors
    /// Same errors as [`value`](Self::value).
    pub fn values(&mut self, name: &str) -> Result<Vec<Value>, Error> {
        let indices = indices::<M>(name)?;
        let mut values = Vec::new();
        let base = variable::<M>(indices[0]).base();
        self.instance.get(&indices, &[base], &mut |_, value| values.push(value))?;
        self.instance.listen();
        Ok(values)
    }

    /// Serializes the state of the simulation: the time, the variables whose values are fields of the model, and the
    /// fields that `memory` in its table lists.
    ///
    /// # Errors
    /// Fails if the state cannot be saved.
    pub fn save(&mut self) -> Result<Vec<u8>, Error> {
        let handle = self.instance.save(0)?;
        let mut bytes = vec![0; self.instance.serialized_size(handle)?];
        self.instance.serialize(handle, &mut bytes)?;
        drop(self.instance.remove(handle)?);
        Ok(bytes)
    }

    /// Restores a state that this or another simulation has saved.
    ///
    /// # Errors
    /// Fails if the bytes are not a state of this model, or if the model rejects the state.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<&mut Self, Error> {
        let handle = self.instance.deserialize(bytes, 0)?;
        self.instance.restore(handle)?;
        drop(self.instance.remove(handle)?);
        Ok(self)
    }

    /// Returns the messages of the model and of this crate since the last call.
    pub fn messages(&mut self) -> Vec<(Status, String)> {
        self.instance.logger.take().into_iter().map(|message| (message.status, message.message)).collect()
    }
}

impl From<Box<Rejection>> for Error {
    fn from(rejection: Box<Rejection>) -> Self {
        Self::new(rejection.message)
    }
}

fn variable<M: Variables>(index: u32) -> &'static Variable<M> {
    &M::TABLE[index as usize]
}

/// Returns the indices in the table of a variable, of one element of an array, or of all its elements.
fn indices<M: Exported>(name: &str) -> Result<Vec<u32>, Error> {
    let of_name = |of: &Variable<M>| of.name() == name || of.length() > 1 && of.name_of_array() == name;
    let indices: Vec<u32> =
        (0..).zip(M::TABLE).filter(|(_, of)| of_name(of)).map(|(index, _)| index).collect();
    if indices.is_empty() {
        let names: Vec<_> = M::LINES.iter().map(Variable::name).collect();
        return Err(Error::new(format!(
            "{} has no variable {name}; it has {}",
            M::INFO.name,
            names.join(", ")
        )));
    }
    Ok(indices)
}
