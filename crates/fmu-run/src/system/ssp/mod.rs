//! SSP files (System Structure and Parameterization 1.0).

mod open;
mod parameters;
mod read;
mod routes;
mod source;
#[cfg(feature = "write")]
mod write;

use crate::system::known::Known;
pub(super) use read::{WARNINGS, child, children, needed};
pub(super) use source::Base;

/// Type of the components that are FMUs.
const FMU: &str = "application/x-fmu-sharedlibrary";

/// Elements and attributes of SSP 1.0 that have a meaning here, and those of SSP 2.0 that change no value. The values of parameters are
/// checked where they are read.
#[rustfmt::skip]
const KNOWN: &[Known] = &[
    ("SystemStructureDescription", &["System", "Enumerations", "Units", "DefaultExperiment", "MetaData", "Signature",
        "Annotations"], &["version", "name", "author", "fileversion", "copyright", "license", "generationTool",
        "generationDateAndTime"]),
    ("System", &["Connectors", "ElementGeometry", "ParameterBindings", "MetaData", "Signature", "Elements", "Connections",
        "SignalDictionaries", "SystemGeometry", "GraphicalElements", "Annotations"], &["name"]),
    ("Elements", &["Component", "SignalDictionaryReference", "System"], &[]),
    ("Component", &["Connectors", "ElementGeometry", "ParameterBindings", "MetaData", "Signature", "Annotations"], &["name",
        "type", "source", "implementation"]),
    ("Connectors", &["Connector"], &[]),
    ("Connector", &["Real", "Float64", "Float32", "Integer", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64",
        "UInt64", "Boolean", "String", "Enumeration", "Binary", "Clock", "ConnectorGeometry", "Annotations"], &["name",
        "kind"]),
    ("Connections", &["Connection"], &[]),
    ("Connection", &["LinearTransformation", "BooleanMappingTransformation", "IntegerMappingTransformation",
        "EnumerationMappingTransformation", "ConnectionGeometry", "Annotations"], &["startElement", "startConnector",
        "endElement", "endConnector", "suppressUnitConversion"]),
    ("BooleanMappingTransformation", &["MapEntry"], &[]),
    ("IntegerMappingTransformation", &["MapEntry"], &[]),
    ("EnumerationMappingTransformation", &["MapEntry"], &[]),
    ("MapEntry", &[], &["source", "target"]),
    ("ParameterBindings", &["ParameterBinding"], &[]),
    ("ParameterBinding", &["ParameterValues", "ParameterMapping", "MetaData", "Signature", "Annotations"], &["type", "source",
        "sourceBase", "prefix"]),
    ("ParameterValues", &["ParameterSet"], &[]),
    ("ParameterSet", &["Parameters", "Enumerations", "Units", "MetaData", "Signature", "Annotations"], &["version", "name",
        "author", "fileversion", "copyright", "license", "generationTool", "generationDateAndTime"]),
    ("Parameters", &["Parameter"], &[]),
    ("Parameter", &["Real", "Float64", "Float32", "Integer", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64",
        "UInt64", "Boolean", "String", "Enumeration", "Binary", "Annotations"], &["name"]),
    ("ParameterMapping", &["ParameterMapping", "MappingEntry", "MetaData", "Signature", "Annotations"], &["type", "source",
        "sourceBase", "version", "name", "author", "fileversion", "copyright", "license", "generationTool",
        "generationDateAndTime"]),
    ("MappingEntry", &["LinearTransformation", "BooleanMappingTransformation", "IntegerMappingTransformation",
        "EnumerationMappingTransformation", "Annotations"], &["source", "target", "suppressUnitConversion"]),
    ("Enumerations", &["Enumeration"], &[]),
    ("Item", &[], &["name", "value"]),
    ("Units", &["Unit"], &[]),
    ("Unit", &["BaseUnit", "Annotations"], &["name"]),
    ("BaseUnit", &[], &["kg", "m", "s", "A", "K", "mol", "cd", "rad", "factor", "offset"]),
    ("DefaultExperiment", &["Annotations"], &["startTime", "stopTime"]),
];
