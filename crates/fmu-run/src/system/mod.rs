//! Systems of connected FMUs.

mod configured;
mod definition;
mod elements;
mod known;
mod order;
mod osp;
mod ssp;
#[cfg(feature = "write")]
mod structure;
mod variables;

use crate::change::Change;
use crate::connector::{Connector, Place, joined};
use crate::description::Description;
use crate::error::{Error, request};
use crate::fmu::Loaded;
use crate::lookup::{Found, is_exact};
use crate::messages::Feed;
use crate::pool::Pool;
use crate::selection::{Assigned, Selection};
pub use elements::Elements;
use fmi_abi::description::{Fault, Offer};
use fmi_abi::files::Limits;
use fmi_abi::{BaseType, Causality, Interface, Value};
pub(crate) use order::Exchange;
pub use order::Order;
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::path::Path;
use std::sync::{Arc, OnceLock};
#[cfg(feature = "write")]
pub use structure::{CheckedStructure, SystemStructure};
pub use variables::Variables;

/// Connected FMUs in Co-Simulation. A system runs like one FMU, also in parallel in [batches](System::run) and as
/// [instances](System::instances). An [`Fmu`](crate::Fmu) is a system with one component, which may also run in Model Exchange.
///
/// Variables are named `component.variable`, or by the names of the system's inputs and outputs. During a step, each component
/// keeps the values that its inputs had at the start of the step. [`Order`] determines when outputs are passed to inputs.
#[derive(Clone, Debug)]
pub struct System(Arc<Definition>);

#[derive(Debug)]
struct Definition {
    name: String,
    components: Vec<Component>,
    /// Indices of the components by name.
    by_name: HashMap<String, usize>,
    /// Lengths of the names of the components, in bytes.
    lengths: BTreeSet<usize>,
    /// The system's inputs and outputs by name.
    connectors: BTreeMap<String, Connector>,
    /// Names of inputs and outputs of the system that no connection leads to an FMU.
    loose: HashSet<String>,
    /// Connections from outputs to inputs.
    connections: Vec<(Place, Place)>,
    /// For each connection, the change of values on the way. Empty if units must be equal instead.
    changes: Vec<Change>,
    /// Index of the first connection to each input, which is identified by its component and its [key](Variable::key).
    sources: HashMap<(usize, u64), usize>,
    exchange: Exchange,
    start: Vec<(Place, Value)>,
    warnings: Vec<String>,
    stop_time: Option<f64>,
    pool: Pool,
    /// Arrays by name, found when they are first needed.
    arrays: OnceLock<HashMap<String, Elements>>,
}

/// A component.
#[derive(Debug)]
pub(crate) struct Component {
    /// Name; empty for a single component.
    pub name: String,
    pub fmu: Arc<Loaded>,
}

/// Specification of a system: components and connections.
#[derive(Clone, Debug, Default)]
pub struct Composition<'a> {
    /// Name of the system.
    pub name: &'a str,
    /// Names and FMUs of the components; an FMU may occur several times.
    pub components: Vec<(&'a str, &'a Fmu)>,
    /// Connections from outputs to inputs, as `component.variable`.
    pub connections: Vec<(&'a str, &'a str)>,
    /// Determines when outputs are passed to inputs.
    pub order: Order,
}

impl System {
    /// Connects FMUs.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if there are no components, and for empty or duplicate names of components, unknown variables,
    /// wrong causalities, connected strings or bytes, connected variables that do not match, inputs with two connections, and
    /// algebraic loops. Returns [`Error::Fmu`] if an FMU does not support Co-Simulation, or occurs twice although a process may
    /// create only one instance of it.
    pub fn connect(composition: &Composition) -> Result<Self, Error> {
        let components =
            composition.components.iter().map(|(name, fmu)| ((*name).to_owned(), Arc::clone(fmu.loaded())));
        let mut definition =
            Definition::of(composition.name, components.map(|(name, fmu)| Component { name, fmu }).collect());
        definition.check_components()?;
        let connections = composition
            .connections
            .iter()
            .map(|(from, to)| Ok((definition.place(from)?, definition.place(to)?)));
        let connections = connections.collect::<Result<_, Error>>()?;
        definition.set_connections(connections, Vec::new());
        definition.finish(composition.order)
    }

    /// Creates a system with a single FMU.
    pub(crate) fn of_one(fmu: Loaded) -> Self {
        let name = fmu.description.model_name.clone();
        Self(Arc::new(Definition::of(&name, vec![Component { name: String::new(), fmu: Arc::new(fmu) }])))
    }

    /// Returns the name of the system; for an FMU, the name of its model.
    pub fn name(&self) -> &str {
        &self.0.name
    }

    /// Returns the connections, from outputs to inputs, in the stages in which values are passed at a communication point.
    pub fn stages(&self) -> Vec<Vec<(&str, &str)>> {
        let stages = self.0.exchange.stages.iter();
        let pairs = stages.map(|stage| stage.outputs.names().iter().zip(stage.inputs.names()));
        pairs.map(|pairs| pairs.map(|(from, to)| (from.as_str(), to.as_str())).collect()).collect()
    }

    /// Returns the start values of the system by variable: numbers and strings.
    pub fn start(&self) -> impl Iterator<Item = (String, &Value)> {
        self.0.start.iter().map(|(place, value)| (self.0.name_of(place), value))
    }

    /// Returns the start values of the system: the variable in its FMU, its name in the system, and the value.
    pub(crate) fn own_start(&self) -> impl Iterator<Item = Result<(Found<'_>, String, &Value), Error>> {
        let all = self.0.start.iter();
        all.map(|(place, value)| Ok((self.0.existing(place)?, self.0.name_of(place), value)))
    }

    /// Returns what was strange when the system was opened: values that are not converted because a unit is not defined, and values,
    /// elements and attributes that are not used because they have no variable or no meaning.
    pub fn warnings(&self) -> &[String] {
        &self.0.warnings
    }

    /// Returns the stop time of the system's experiment, s, if given.
    pub fn stop_time(&self) -> Option<f64> {
        self.0.stop_time
    }

    /// Finds variables by their names.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if a name is unknown, or if the values of a variable are strings or bytes.
    pub fn select(&self, names: &[impl AsRef<str>]) -> Result<Selection, Error> {
        let (mut selection, mut known, mut assigned) =
            (Selection::default(), HashMap::new(), Assigned::default());
        for name in names.iter().map(AsRef::as_ref) {
            let found = self.find_numbers(name)?;
            selection.push_to(&mut known, name, &found);
            assigned.add(name, &found);
        }
        // A variable may be read twice, but not set to two values.
        assigned.check("variables").unwrap_or_else(|error| selection.forbid(error.to_string()));
        Ok(selection)
    }

    /// Returns the elements of a whole array by its name: an array of FMI 3.0, or variables `y[1]`, `y[2]`, ... whose indices are
    /// complete. Returns `None` for all other names, including variables.
    ///
    /// ```no_run
    /// # fn main() -> Result<(), fmu_run::Error> {
    /// # // SAFETY: the library of a trusted FMU.
    /// let fmu = unsafe { fmu_run::Fmu::open("rod.fmu".as_ref()) }?;
    /// let system = fmu.system();
    /// if let Some(temperatures) = system.array("T") {
    ///     println!("{:?} {:?}", temperatures.sizes, system.select(&temperatures.names)?);
    /// }
    /// # Ok(())
    /// # }
    /// ```
    pub fn array(&self, name: &str) -> Option<&Elements> {
        if !self.0.matches(name).is_empty() || self.0.connectors.contains_key(name) {
            return None;
        }
        let all = self.0.arrays.get_or_init(|| {
            let names: Vec<_> = self.variables().iter().map(|(name, _)| name).collect();
            elements::arrays(names.iter().map(String::as_str))
        });
        all.get(name)
    }

    /// Returns the type of a variable if `f64` cannot represent all of its values: String, Binary, Int64 or UInt64. Returns `None`
    /// for other variables and for arrays.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if the name is unknown.
    pub fn exact_type(&self, name: &str) -> Result<Option<BaseType>, Error> {
        if self.array(name).is_some() {
            return Ok(None);
        }
        Ok(Some(self.find_any(name)?.variable.base).filter(|base| is_exact(*base)))
    }

    /// Returns whether a variable of a single FMU has a value only while a clock is active. Runs can set it as an input and read it as an
    /// output.
    pub fn is_clocked(&self, name: &str) -> bool {
        self.find_clocked(name).is_some()
    }

    /// Returns the conversion between the unit of a variable and another unit, as factor and offset: value in
    /// the other unit = factor * value + offset.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if the variable is unknown or has no unit, or if its FMU does not define the conversion.
    pub fn display_unit(&self, name: &str, unit: &str) -> Result<(f64, f64), Error> {
        self.find_any(name)?.display_unit(name, unit)
    }

    /// Frees the instances and the threads that earlier [runs](Self::run) have kept for later ones. They are also freed with the last
    /// clone of the system.
    pub fn release(&self) {
        self.0.pool.clear();
    }

    pub(crate) fn pool(&self) -> &Pool {
        &self.0.pool
    }

    /// Returns whether instances may be kept while no run uses them.
    pub(crate) fn may_be_idle(&self, interface: Interface) -> bool {
        let offers =
            self.components().iter().filter_map(|component| component.fmu.description.offer(interface));
        offers.fold(true, |all, offer| all && !offer.once_per_process && !offer.needs_execution_tool)
    }

    pub(crate) fn components(&self) -> &[Component] {
        &self.0.components
    }

    /// Returns a collector for the messages of instances of this system.
    pub(crate) fn feed(&self) -> Arc<Feed> {
        Feed::of(self.components().iter().map(|component| component.name.clone()).collect())
    }

    pub(crate) fn exchange(&self) -> &Exchange {
        &self.0.exchange
    }

    /// Returns the FMU if the system is a single FMU and not a composition.
    pub(crate) fn sole(&self) -> Option<&Loaded> {
        self.components()
            .first()
            .filter(|component| component.name.is_empty())
            .map(|component| &*component.fmu)
    }

    /// Fails if a component does not support this interface type, or if a system is to run in Model Exchange.
    pub(crate) fn check_interface(&self, interface: Interface) -> Result<(), Error> {
        if interface == Interface::ModelExchange && self.sole().is_none() {
            return Err(Error::Fmu(format!(
                "{} is a system; systems run in Co-Simulation only, and a single FMU also in Model Exchange",
                self.name()
            )));
        }
        for Component { fmu, .. } in self.components() {
            // States and event indicators would be missing. In Co-Simulation their number does not matter.
            let mut faults = fmu.description.faults.iter();
            if interface == Interface::ModelExchange
                && let Some((_, why)) = faults.find(|(fault, _)| *fault == Fault::Structure)
            {
                return Err(Error::Fmu(format!("modelDescription.xml: {why}")));
            }
            fmu.library(interface)?;
        }
        Ok(())
    }

    /// Fails if a component has a clock that must tick, for callers that do not tick clocks.
    pub(crate) fn check_unclocked(&self) -> Result<(), Error> {
        let mut needed = self
            .components()
            .iter()
            .filter_map(|Component { name, fmu }| Some(joined(name, fmu.description.needed_clock()?)));
        needed.next().map_or(Ok(()), |clock| {
            Err(Error::Fmu(format!(
                "{clock} is an input clock that must tick at its own times, but only the function run, for a single FMU, ticks clocks"
            )))
        })
    }

    /// Returns the clocked variable of a single FMU with this name, if there is one. Only runs can set and read it.
    pub(crate) fn find_clocked(&self, name: &str) -> Option<Found<'_>> {
        let description = &self.sole()?.description;
        let variable = description.clocked(name)?;
        Some(Found { component: 0, variable, description, source: None, connector: None })
    }

    /// Returns the first variable with this name, which may be clocked.
    fn find_any(&self, name: &str) -> Result<Found<'_>, Error> {
        self.find_clocked(name).map_or_else(|| self.find_first(name), Ok)
    }

    /// Returns the interface type of runs: the requested one, or Co-Simulation by default. For a single FMU that has only Model
    /// Exchange, the default is Model Exchange.
    pub(crate) fn interface(&self, asked: Option<Interface>) -> Result<Interface, Error> {
        let has_only_model_exchange = self.sole().is_some_and(|fmu| fmu.description.co_simulation.is_none());
        let interface = asked.unwrap_or(match has_only_model_exchange {
            true => Interface::ModelExchange,
            false => Interface::CoSimulation,
        });
        self.check_interface(interface)?;
        Ok(interface)
    }

    /// Returns whether a process may create only one instance of the system, because of one of its FMUs.
    pub(crate) fn once_per_process(&self, interface: Interface) -> bool {
        self.components().iter().any(|component| component.fmu.once_per_process(interface))
    }

    /// Returns the number of threads for `count` runs or instances: the requested number, or one for each processor, but at most
    /// `count`, and only one if a process may create only one instance.
    pub(crate) fn threads(
        &self,
        interface: Interface,
        asked: Option<usize>,
        count: usize,
    ) -> Result<usize, Error> {
        if asked == Some(0) {
            return request("threads must be at least 1".to_owned());
        }
        // Returns early, because counting the processors takes longer than a short run.
        if count <= 1 || self.once_per_process(interface) {
            return Ok(1);
        }
        let threads = asked.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
        Ok(threads.min(count))
    }

    /// Returns the variables with this name. There are several if an input of the system is connected to several inputs.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if there is none. The message suggests a similar name.
    pub(crate) fn find(&self, name: &str) -> Result<Vec<Found<'_>>, Error> {
        self.0.find(name)
    }

    pub(crate) fn find_first(&self, name: &str) -> Result<Found<'_>, Error> {
        self.find(name).map(|found| found[0])
    }

    /// Returns the variables with this name. Fails unless they are numeric.
    pub(crate) fn find_numbers(&self, name: &str) -> Result<Vec<Found<'_>>, Error> {
        let found = self.find(name)?;
        found.iter().try_for_each(|found| found.check_number(name))?;
        Ok(found)
    }

    /// Returns the variables with this name. Fails unless they accept a start value, which inputs that are connected to outputs do
    /// not.
    pub(crate) fn find_startable(&self, name: &str) -> Result<Vec<Found<'_>>, Error> {
        let found = self.find(name)?;
        found.iter().try_for_each(|found| found.check_start(name))?;
        Ok(found)
    }

    /// Returns the variables with this name. Fails unless they are Real inputs of a single FMU that accepts input derivatives.
    pub(crate) fn takes_input_derivative(&self, name: &str) -> Result<Vec<Found<'_>>, Error> {
        let offer = self.sole().and_then(|fmu| fmu.description.co_simulation.as_ref());
        if offer.is_none_or(|offer| !offer.input_derivatives) {
            return request(format!(
                "{} takes no input derivatives (canInterpolateInputs of FMI 2.0)",
                self.name()
            ));
        }
        let variables = self.find_numbers(name)?;
        let of = variables[0].variable;
        if of.base != BaseType::Real || of.causality != Causality::Input {
            return request(format!("{name} is not a Real input; only these have input derivatives"));
        }
        Ok(variables)
    }

    /// Returns the name of the first model that needs steps of equal size in Co-Simulation, if there is one (section 4.3.1 of FMI 2.0,
    /// 4.4 of FMI 3.0).
    pub(crate) fn fixed_step(&self) -> Option<&str> {
        let descriptions = self.components().iter().map(|component| &component.fmu.description);
        let mut fixed = descriptions
            .filter(|of| of.offer(Interface::CoSimulation).is_some_and(|offer| !offer.variable_step_size));
        fixed.next().map(|of| of.model_name.as_str())
    }

    /// Fails if a component lacks a capability for this interface type.
    pub(crate) fn check_offer(
        &self,
        interface: Interface,
        offers: fn(&Offer) -> bool,
        what: &str,
    ) -> Result<(), Error> {
        let descriptions = self.components().iter().map(|component| &component.fmu.description);
        let mut lacking = descriptions.filter(|of| !of.offer(interface).is_some_and(offers));
        lacking.next().map_or(Ok(()), |of| request(format!("{} {what}", of.model_name)))
    }
}

/// An FMU, unpacked and loaded once for any number of runs and instances. It stays loaded while this object, a clone of it, a
/// [`Planned`](crate::Planned) batch or an instance exists. An FMU is a [`System`] with one component.
#[derive(Clone, Debug)]
pub struct Fmu(System);

impl Fmu {
    /// Unpacks an FMU and loads its library. It is `unsafe` because it runs code of the FMU.
    ///
    /// ```compile_fail,E0133
    /// let fmu = fmu_run::Fmu::open("model.fmu".as_ref());
    /// ```
    ///
    /// # Safety
    /// The functions of the library have the types of the FMI standard, and it is sound to load the library and to call them.
    ///
    /// # Errors
    /// Returns [`Error::Fmu`] if the file is not an FMU, has no library for this platform, or needs another
    /// program.
    pub unsafe fn open(path: &Path) -> Result<Self, Error> {
        // SAFETY: the caller guarantees that the library is sound.
        unsafe { Loaded::open(path, false, &mut Limits::default()) }
            .map(|loaded| Self(System::of_one(loaded)))
    }

    /// Opens an FMU as [`open`](Self::open) does, even if its library starts another program (`needsExecutionTool`), which must be
    /// installed. If the program is missing, the FMU reports an error when it runs.
    ///
    /// # Safety
    /// The requirement of [`open`](Self::open), and it is sound to start the program.
    ///
    /// # Errors
    /// Same errors as [`open`](Self::open).
    pub unsafe fn open_with_execution_tool(path: &Path) -> Result<Self, Error> {
        // SAFETY: the caller guarantees that the library is sound and that the program may be started.
        unsafe { Loaded::open(path, true, &mut Limits::default()) }.map(|loaded| Self(System::of_one(loaded)))
    }

    /// Returns the model description.
    pub fn description(&self) -> &Description {
        &self.loaded().description
    }

    /// Returns the system with this FMU as its only component. It has the functions for variables, runs and instances.
    pub fn system(&self) -> &System {
        &self.0
    }

    pub(crate) fn loaded(&self) -> &Arc<Loaded> {
        &self.0.components()[0].fmu
    }
}

/// Returns the most similar name, if one is similar enough. Derivatives rank lower, because users rarely ask for them.
pub fn nearest(name: &str, names: impl Iterator<Item = String>) -> Option<String> {
    /// Minimum similarity.
    const SIMILAR: f64 = 0.8;
    let wanted = name.to_lowercase();
    let similarity = |known: &String| {
        let known = known.to_lowercase();
        // A name of at least two letters that is a prefix of the other one ranks higher.
        let short =
            known.len().min(wanted.len()) > 1 && (wanted.starts_with(&known) || known.starts_with(&wanted));
        let derived = known.starts_with("der(") && !wanted.starts_with("der(");
        0.1 * f64::from(u8::from(short)) - f64::from(u8::from(derived))
            + strsim::jaro_winkler(&known, &wanted)
    };
    let names =
        names.map(|known| (similarity(&known), known)).filter(|(similarity, _)| *similarity > SIMILAR);
    names.reduce(|best, other| if other.0 > best.0 { other } else { best }).map(|(_, name)| name)
}
