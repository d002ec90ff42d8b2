//! Compiles and packs the FMU of `resets.c`.

use crate::c_fmus::{compiled, open, pack};
use fmu_run::{Standard, System};
use std::sync::OnceLock;
use tempfile::TempDir;

const DESCRIPTION: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Resets" guid="GUID">
  <CoSimulation modelIdentifier="resets" canHandleVariableCommunicationStepSize="true"/>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input" variability="continuous"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="1" causality="output" variability="continuous"><Real/></ScalarVariable>
    <ScalarVariable name="factor" valueReference="2" causality="parameter" variability="fixed"><Real start="1"/></ScalarVariable>
    <ScalarVariable name="bias" valueReference="3" causality="parameter" variability="fixed"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="fails" valueReference="4" causality="parameter" variability="fixed"><Real start="-1"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="2"/></Outputs></ModelStructure>
</fmiModelDescription>
"#;

/// The FMU of `resets.c` with one of its manners, and the directory with its record: a file to which the FMU writes when an
/// instance is created, reset or freed.
pub struct Recorded {
    pub fmu: Option<System>,
    directory: TempDir,
}

impl Recorded {
    /// Builds and opens the FMU with this manner and with an attribute that is added to its element CoSimulation.
    pub fn open(manner: &str, attribute: &str) -> Self {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("resets.fmu");
        let guid = format!("{{{manner}:{}}}", directory.path().join("record").display());
        let xml = DESCRIPTION
            .replace("GUID", &guid)
            .replace("<CoSimulation", &format!("<CoSimulation {attribute}"));
        static LIBRARY: OnceLock<Vec<u8>> = OnceLock::new();
        let library = LIBRARY.get_or_init(|| compiled("batches/resets.c", "cc", &[]));
        pack(&path, Standard::Fmi2, xml, ("resets", library), &[]);
        let fmu = open(&path).system().clone();
        Self { fmu: Some(fmu), directory }
    }

    pub fn fmu(&self) -> &System {
        self.fmu.as_ref().unwrap()
    }

    /// Returns how many instances have been created, reset and freed so far.
    pub fn counts(&self) -> [usize; 3] {
        let record = std::fs::read_to_string(self.directory.path().join("record")).unwrap_or_default();
        ['+', 'r', '-'].map(|of| record.matches(of).count())
    }
}
