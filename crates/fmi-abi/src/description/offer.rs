//! Capabilities of an FMU for one interface type.

use super::faults::Faults;
use super::read::{attribute_or_empty, elements};
use crate::{Standard, is_plain_file_name, shown};
use roxmltree::Node;
use std::collections::BTreeMap;

/// Capabilities of an FMU for one interface type.
#[derive(Clone, Debug, PartialEq)]
pub struct Offer {
    /// `modelIdentifier`, the name of the library; empty if missing.
    pub identifier: String,
    /// Whether a process may have only one instance.
    pub once_per_process: bool,
    /// Whether the library starts another program, which must be installed.
    pub needs_execution_tool: bool,
    /// Whether steps of Co-Simulation may have different sizes (`canHandleVariableCommunicationStepSize`).
    pub variable_step_size: bool,
    /// Whether the FMU accepts input derivatives (FMI 2.0, `canInterpolateInputs`).
    pub input_derivatives: bool,
    /// Whether the FMU provides directional derivatives (`providesDirectionalDerivative`, in FMI 3.0 with a final s).
    pub directional_derivatives: bool,
    /// Whether the state of an instance can be saved and restored (`canGetAndSetFMUstate`, in FMI 3.0
    /// `canGetAndSetFMUState`).
    pub saves_states: bool,
    /// Whether saved states can be serialized (`canSerializeFMUstate`).
    pub serializes_states: bool,
    /// Highest order of output derivatives (`maxOutputDerivativeOrder`), if given.
    pub max_output_derivative_order: Option<u32>,
    /// Names of the C sources that an importer compiles (FMI 2.0).
    pub source_files: Vec<String>,
    /// The Boolean attributes that the description contains.
    pub(super) flags: BTreeMap<&'static str, bool>,
    pub(super) fixed_internal_step_size: Option<f64>,
}

/// The Boolean attributes of interface types in FMI 2.0 and 3.0, in the order in which they are written.
pub(super) const FLAGS: [&str; 21] = [
    "completedIntegratorStepNotNeeded",
    "canGetAndSetFMUState",
    "canSerializeFMUState",
    "providesDirectionalDerivatives",
    "providesAdjointDerivatives",
    "providesPerElementDependencies",
    "needsCompletedIntegratorStep",
    "canHandleVariableCommunicationStepSize",
    "canInterpolateInputs",
    "canRunAsynchronuously",
    "canNotUseMemoryManagementFunctions",
    "canGetAndSetFMUstate",
    "canSerializeFMUstate",
    "providesDirectionalDerivative",
    "providesIntermediateUpdate",
    "canReturnEarlyAfterIntermediateUpdate",
    "mightReturnEarlyFromDoStep",
    "hasEventMode",
    "providesEvaluateDiscreteStates",
    "needsExecutionTool",
    "canBeInstantiatedOnlyOncePerProcess",
];

impl Offer {
    /// Returns the capabilities with these Boolean attributes; those without a value are missing in the description.
    ///
    /// # Panics
    /// If an attribute is none of FMI 2.0 or 3.0.
    pub fn new(standard: Standard, identifier: impl Into<String>, flags: &[(&'static str, bool)]) -> Self {
        let flags: BTreeMap<_, _> = flags.iter().copied().collect();
        assert!(flags.keys().all(|name| FLAGS.contains(name)), "{flags:?} has an unknown attribute");
        let is_either = |names: &[&str]| names.iter().any(|name| flags.get(name) == Some(&true));
        Self {
            identifier: identifier.into(),
            once_per_process: is_either(&["canBeInstantiatedOnlyOncePerProcess"]),
            needs_execution_tool: is_either(&["needsExecutionTool"]),
            variable_step_size: is_either(&["canHandleVariableCommunicationStepSize"]),
            input_derivatives: standard == Standard::Fmi2 && is_either(&["canInterpolateInputs"]),
            directional_derivatives: is_either(&[
                "providesDirectionalDerivative",
                "providesDirectionalDerivatives",
            ]),
            saves_states: is_either(&["canGetAndSetFMUstate", "canGetAndSetFMUState"]),
            serializes_states: is_either(&["canSerializeFMUstate", "canSerializeFMUState"]),
            max_output_derivative_order: None,
            source_files: Vec::new(),
            flags,
            fixed_internal_step_size: None,
        }
    }

    pub(super) fn read(node: Node, standard: Standard, faults: &Faults) -> Self {
        let flag = |name| Some((name, faults.read(node, name)?));
        let flags: Vec<_> = FLAGS.into_iter().filter_map(flag).collect();
        let sources = elements(node, "SourceFiles");
        Self {
            max_output_derivative_order: faults.read(node, "maxOutputDerivativeOrder"),
            source_files: sources.map(|file| attribute_or_empty(file, "name")).collect(),
            fixed_internal_step_size: faults.read(node, "fixedInternalStepSize"),
            ..Self::new(standard, attribute_or_empty(node, "modelIdentifier"), &flags)
        }
    }

    /// Fails if the identifier is not safe as the name of a file, because the library is named after it. A library can be loaded even
    /// if the identifier is not an identifier of C, as FMI requires. A missing identifier passes, because it is listed as a fault.
    pub(super) fn check(&self) -> Result<(), String> {
        if self.identifier.is_empty() || is_plain_file_name(&self.identifier) {
            return Ok(());
        }
        Err(format!(
            "modelDescription.xml: modelIdentifier \"{}\" is not the name of a library, such as Model_1",
            shown(&self.identifier)
        ))
    }

    /// Returns whether at least one of these attributes is true.
    pub fn can(&self, names: &[&str]) -> bool {
        names.iter().any(|name| self.flags.get(name) == Some(&true))
    }

    /// Returns the step size to which communication points should be aligned (`fixedInternalStepSize`, FMI 3.0), if it is a
    /// positive and finite number.
    pub fn fixed_internal_step_size(&self) -> Option<f64> {
        self.fixed_internal_step_size.filter(|size| *size > 0.0 && size.is_finite())
    }
}
