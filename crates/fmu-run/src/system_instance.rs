//! An instance of a system: one instance of each component.

use crate::instance::{Experiment, Instance};
use crate::messages::Logging;
use crate::selection::{Selection, Target};
use crate::start::StartValues;
use crate::system::{Exchange, Order, System};
use fmi_abi::client::Rejection;
use fmi_abi::{Interface, Value};
use std::ops::{Deref, DerefMut};
use std::sync::atomic::{AtomicU64, Ordering};

/// Identifies a state that the instances of all components have saved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Saved {
    generation: u64,
    state: fmi_abi::client::Saved,
}

/// Instances of the components. A single instance is stored inline, because with thousands of instances each indirection costs time.
#[derive(Debug)]
enum Components {
    One(Instance),
    Several(Vec<Instance>),
}

impl Deref for Components {
    type Target = [Instance];

    #[inline]
    fn deref(&self) -> &[Instance] {
        match self {
            Self::One(instance) => std::slice::from_ref(instance),
            Self::Several(instances) => instances,
        }
    }
}

impl DerefMut for Components {
    #[inline]
    fn deref_mut(&mut self) -> &mut [Instance] {
        match self {
            Self::One(instance) => std::slice::from_mut(instance),
            Self::Several(instances) => instances,
        }
    }
}

/// An instance of a system. Each function acts on the instances of all components. A single FMU is a system with one component and no
/// connections.
#[derive(Debug)]
pub(crate) struct SystemInstance {
    /// Unique number. Saved states contain it, because they can only be restored in the instances that saved them.
    generation: u64,
    components: Components,
    system: System,
    /// Whether inputs must be updated before the next get or step ([`Order::Dependencies`]).
    is_due: bool,
    /// Outputs after the last step ([`Order::Jacobi`]).
    passed: Vec<f64>,
    /// The value of `passed` for each saved state.
    saved: Vec<Vec<f64>>,
    /// Buffers, reused by all calls.
    row: Vec<f64>,
    buffer: Vec<f64>,
}

impl SystemInstance {
    /// Resets used instances or creates new ones. The error contains the reason, and whether the FMU logged no message.
    pub fn renewed(
        used: Option<Self>,
        system: &System,
        mode: (Interface, bool),
        logging: &Logging,
    ) -> Result<Self, (String, bool)> {
        // If an FMU cannot be reset, the old instances are freed before new ones are created, because some FMUs permit only one.
        match used.and_then(Self::reset) {
            Some(used) => Ok(used),
            None => Self::new(system, mode, logging),
        }
    }

    /// Creates new instances for an interface type, in Co-Simulation with event mode or without. The error contains the reason, and whether
    /// the FMU logged no message.
    pub fn new(system: &System, mode: (Interface, bool), logging: &Logging) -> Result<Self, (String, bool)> {
        let components = system.components().iter().enumerate();
        let components = components
            .map(|(index, component)| Instance::new(&component.fmu, (index, &component.name), mode, logging));
        Ok(Self::of(system, components.collect::<Result<_, _>>()?))
    }

    /// Combines instances of all components of a system, in their order.
    pub fn of(system: &System, mut components: Vec<Instance>) -> Self {
        let only = if components.len() == 1 { components.pop() } else { None };
        let components = only.map_or(Components::Several(components), Components::One);
        static GENERATION: AtomicU64 = AtomicU64::new(0);
        let generation = GENERATION.fetch_add(1, Ordering::Relaxed);
        let (system, [passed, row, buffer]) = (system.clone(), [const { Vec::new() }; 3]);
        Self { generation, components, system, is_due: false, passed, saved: Vec::new(), row, buffer }
    }

    pub fn into_components(self) -> Vec<Instance> {
        match self.components {
            Components::One(instance) => vec![instance],
            Components::Several(instances) => instances,
        }
    }

    /// Resets the instances. Returns `None` if an FMU cannot be reset.
    pub fn reset(mut self) -> Option<Self> {
        if !self.is_alive() {
            return None;
        }
        self.components.iter_mut().try_for_each(|instance| instance.reset()).ok()?;
        self.is_due = false;
        Some(self)
    }

    /// Sets start values and enters Initialization Mode, in an order that both FMI versions allow.
    pub fn begin(
        &mut self,
        experiment: Experiment,
        start: &StartValues,
        number: usize,
    ) -> Result<(), Rejection> {
        let Experiment { start_time, stop_time, tolerance } = experiment;
        let tolerances: Vec<_> = self
            .system
            .components()
            .iter()
            .map(|component| tolerance.of(&component.fmu.description))
            .collect();
        self.each(|index, instance| instance.set_up(start_time, stop_time, tolerances[index]))?;
        for (target, value) in start.values(number) {
            self.components[target.component].set(
                target.base,
                &[target.reference],
                std::slice::from_ref(value),
            )?;
        }
        let numbers: Vec<_> = start.numbers(number).collect();
        // Successive numbers of one type are set with one call, because an FMU may require that they are consistent, for example
        // increasing.
        let together = |(one, _): &(Target, f64), (next, _): &(Target, f64)| {
            (one.component, one.base) == (next.component, next.base)
        };
        for group in numbers.chunk_by(together) {
            let Target { component, base, .. } = group[0].0;
            let (references, values): (Vec<_>, Vec<_>) =
                group.iter().map(|(target, value)| (target.reference, *value)).unzip();
            self.components[component].set(base, &references, &values)?;
        }
        self.each(|index, instance| {
            instance.enter_initialization_mode(start_time, stop_time, tolerances[index])
        })
    }

    pub fn exit_initialization_mode(&mut self) -> Result<(), Rejection> {
        self.agree()?;
        self.each(|_, instance| instance.exit_initialization_mode())?;
        self.stepped()
    }

    /// Passes outputs to inputs in Initialization Mode, where the dependencies may differ from the ones in later modes, and repeats
    /// this until no value changes. Fails if the values do not converge. With [`Order::Jacobi`] they need not converge, but are
    /// passed at most as many times as there are components, as in libcosim.
    fn agree(&mut self) -> Result<(), Rejection> {
        let Exchange { order, stages } = self.system.exchange();
        let order = *order;
        let rounds = match order {
            _ if stages.is_empty() => return Ok(()),
            Order::Jacobi => self.components.len(),
            Order::Dependencies => 1 + stages.iter().map(|stage| stage.outputs.len()).sum::<usize>(),
        };
        let mut before: Vec<u64> = Vec::new();
        for _ in 0..rounds {
            let mut now = Vec::new();
            self.pass_all_on(|values| now.extend(values.iter().map(|value| value.to_bits())))?;
            if now == before {
                return Ok(());
            }
            before = now;
        }
        match order {
            Order::Jacobi => Ok(()),
            Order::Dependencies => Err(Rejection::without_fmu(
                "initialization",
                "the outputs depend on each other before the first step, so that the exchange of values does not converge",
            )),
        }
    }

    /// Updates the connected inputs, if necessary.
    #[inline(always)]
    fn pass_on(&mut self) -> Result<(), Rejection> {
        if self.is_due { self.pass_all_on(|_| ()) } else { Ok(()) }
    }

    /// Updates the connected inputs, stage by stage. `observe` gets the outputs of each stage.
    fn pass_all_on(&mut self, mut observe: impl FnMut(&[f64])) -> Result<(), Rejection> {
        let Self { components, system, row, buffer, .. } = self;
        for stage in &system.exchange().stages {
            row.resize(stage.outputs.len(), 0.0);
            stage.get(components, buffer, row)?;
            observe(row);
            stage.inputs.set(components, buffer, row)?;
        }
        self.is_due = false;
        Ok(())
    }

    /// Prepares the next exchange of values after a step or the initialization.
    #[inline]
    fn stepped(&mut self) -> Result<(), Rejection> {
        let Self { components, system, passed, buffer, .. } = self;
        let Exchange { order, stages } = system.exchange();
        match (order, stages.first()) {
            (_, None) => {}
            (Order::Dependencies, _) => self.is_due = true,
            (Order::Jacobi, Some(stage)) => {
                passed.resize(stage.outputs.len(), 0.0);
                stage.get(components, buffer, passed)?;
            }
        }
        Ok(())
    }

    /// Performs a step. Also returns an error if an FMU ends the simulation, but only after all other FMUs have performed the step.
    #[inline(always)]
    pub fn step(&mut self, time: f64, size: f64) -> Result<(), Rejection> {
        if let [instance] = &mut *self.components
            && self.system.exchange().stages.is_empty()
        {
            return instance.step(time, size).map(drop);
        }
        self.pass_on()?;
        if !self.passed.is_empty() {
            let stage = &self.system.exchange().stages[0];
            stage.inputs.set(&mut self.components, &mut self.buffer, &self.passed)?;
        }
        let mut ended = None;
        self.each(|_, instance| match instance.step(time, size) {
            Err(rejection) if rejection.ended().is_some() => {
                ended.get_or_insert(rejection);
                Ok(())
            }
            stepped => stepped.map(drop),
        })?;
        // An FMU that has ended the simulation does not accept inputs.
        ended.map_or_else(|| self.stepped(), Err)
    }

    #[inline(always)]
    pub fn get(&mut self, variables: &Selection, row: &mut [f64]) -> Result<(), Rejection> {
        self.pass_on()?;
        variables.get(&mut self.components, &mut self.buffer, row)
    }

    #[inline(always)]
    pub fn set(&mut self, variables: &Selection, row: &[f64]) -> Result<(), Rejection> {
        variables.set(&mut self.components, &mut self.buffer, row)?;
        self.changed();
        Ok(())
    }

    /// Returns the exact value of a variable.
    pub fn get_value(&mut self, of: Target) -> Result<Value, Rejection> {
        self.pass_on()?;
        let mut value = Value::Integer(0);
        self.components[of.component].get(of.base, &[of.reference], std::slice::from_mut(&mut value))?;
        Ok(value)
    }

    /// Sets a variable to an exact value.
    pub fn set_value(&mut self, of: Target, value: &Value) -> Result<(), Rejection> {
        self.components[of.component].set(of.base, &[of.reference], std::slice::from_ref(value))?;
        self.changed();
        Ok(())
    }

    /// Notes that the connected inputs must be updated, because a variable has been set.
    #[inline(always)]
    fn changed(&mut self) {
        let Exchange { order, stages } = self.system.exchange();
        self.is_due |= *order == Order::Dependencies && !stages.is_empty();
    }

    /// Returns the instance of a single FMU.
    #[inline]
    pub fn sole(&mut self) -> &mut Instance {
        &mut self.components[0]
    }

    pub fn is_alive(&self) -> bool {
        self.components.iter().all(|instance| instance.is_alive())
    }

    pub fn forget_log(&self) {
        self.components.iter().for_each(|instance| instance.forget_log());
    }

    pub fn terminate(&mut self) -> Result<(), Rejection> {
        self.each(|_, instance| instance.terminate())
    }

    /// Saves the states of all instances.
    pub fn save(&mut self) -> Result<Saved, Rejection> {
        self.keep(|_, instance| instance.save())
    }

    /// Returns the index of a state. Fails if other instances have saved it.
    fn own(&self, saved: Saved) -> Result<fmi_abi::client::Saved, Rejection> {
        if saved.generation == self.generation {
            return Ok(saved.state);
        }
        Err(Rejection::without_fmu(
            "restore",
            "the state was saved before a reset that made a new instance, because the FMU cannot be reset or had failed; save it \
            again, or serialize states that must outlive a reset",
        ))
    }

    /// Fails if the state was saved by other instances, such as earlier ones that have been freed.
    pub fn check_own(&self, saved: Saved) -> Result<(), Rejection> {
        self.own(saved).map(drop)
    }

    pub fn restore(&mut self, saved: Saved) -> Result<(), Rejection> {
        let saved = self.own(saved)?;
        self.each(|_, instance| instance.restore(saved))?;
        match self.saved.get(saved.index()) {
            Some(passed) => self.passed.clone_from(passed),
            None => self.is_due = !self.system.exchange().stages.is_empty(),
        }
        Ok(())
    }

    pub fn forget(&mut self, saved: Saved) -> Result<(), Rejection> {
        // If earlier instances saved the state, it was freed with them.
        let Ok(saved) = self.own(saved) else { return Ok(()) };
        // After an error, the others forget it too, because one number identifies the states of all components.
        let forgotten = self.components.iter_mut().map(|instance| instance.forget(saved));
        forgotten.fold(Ok(()), Result::and)
    }

    /// Serializes a saved state. A single FMU returns the bytes. For a system, the bytes of each component follow their length, which
    /// the FMU chooses; at the end are the outputs of the last step, because the next step sets the inputs to them.
    pub fn serialize(&mut self, saved: Saved) -> Result<Vec<u8>, Rejection> {
        let saved = self.own(saved)?;
        if self.system.sole().is_some() {
            return self.sole().serialize(saved);
        }
        let mut all = Vec::new();
        self.each(|_, instance| {
            let bytes = instance.serialize(saved)?;
            all.extend((bytes.len() as u64).to_le_bytes());
            all.extend(bytes);
            Ok(())
        })?;
        let passed = self.saved.get(saved.index()).into_iter().flatten();
        all.extend(passed.flat_map(|value| value.to_le_bytes()));
        Ok(all)
    }

    pub fn deserialize(&mut self, bytes: &[u8]) -> Result<Saved, Rejection> {
        if self.system.sole().is_some() {
            return self.keep(|_, instance| instance.deserialize(bytes));
        }
        let mut rest = bytes;
        let short = || Rejection::without_fmu("deserialize", "the bytes are not a state of this system");
        let components = self.components.iter().map(|_| {
            let (length, after) = rest.split_first_chunk()?;
            let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
            let (own, after) = after.split_at_checked(length)?;
            rest = after;
            Some(own)
        });
        let components: Vec<_> = components.collect::<Option<_>>().ok_or_else(short)?;
        if rest.len() != size_of::<f64>() * self.passed.len() {
            return Err(short());
        }
        let now = rest.chunks_exact(8).filter_map(|bytes| Some(f64::from_le_bytes(bytes.try_into().ok()?)));
        let before = std::mem::replace(&mut self.passed, now.collect());
        let saved = self.keep(|component, instance| instance.deserialize(components[component]));
        self.passed = before;
        saved
    }

    /// Calls `state`, which saves or de-serializes a state, for each instance, and stores the outputs of the last step. After an
    /// error no state is stored.
    fn keep(
        &mut self,
        mut state: impl FnMut(usize, &mut Instance) -> Result<fmi_abi::client::Saved, Rejection>,
    ) -> Result<Saved, Rejection> {
        let mut done: Option<(usize, fmi_abi::client::Saved)> = None;
        let kept = self.each(|component, instance| {
            let saved = state(component, instance)?;
            assert!(
                done.is_none_or(|(_, first)| first == saved),
                "the states of all components have one number"
            );
            done = Some((component, saved));
            Ok(())
        });
        let (last, saved) = match (kept, done) {
            (Ok(()), Some(done)) => done,
            (Err(rejection), Some((last, saved))) => {
                self.components[..=last].iter_mut().for_each(|instance| _ = instance.forget(saved));
                return Err(rejection);
            }
            (kept, None) => return kept.and(Err(Rejection::without_fmu("save", "there is no instance"))),
        };
        debug_assert_eq!(last + 1, self.components.len(), "each component must have a state");
        if !self.passed.is_empty() {
            self.saved.resize(self.saved.len().max(saved.index() + 1), Vec::new());
            self.saved[saved.index()].clone_from(&self.passed);
        }
        Ok(Saved { generation: self.generation, state: saved })
    }

    fn each(
        &mut self,
        mut body: impl FnMut(usize, &mut Instance) -> Result<(), Rejection>,
    ) -> Result<(), Rejection> {
        self.components.iter_mut().enumerate().try_for_each(|(component, instance)| body(component, instance))
    }
}
