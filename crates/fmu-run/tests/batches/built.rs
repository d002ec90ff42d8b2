//! Packs the FMU of `integrator.c` with a record of its instances.

use fmu_run::{Fmu, System};
use fmu_test_kit::c_models::{library, pack};
use tempfile::TempDir;

const DESCRIPTION: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Resets" guid="GUID">
  <CoSimulation modelIdentifier="integrator" canHandleVariableCommunicationStepSize="true"/>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="1" causality="input" variability="continuous"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="2" causality="output" variability="continuous"><Real/></ScalarVariable>
    <ScalarVariable name="factor" valueReference="19" causality="parameter" variability="fixed"><Real start="1"/></ScalarVariable>
    <ScalarVariable name="bias" valueReference="20" causality="parameter" variability="fixed"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="fails" valueReference="21" causality="parameter" variability="fixed"><Real start="-1"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="2"/></Outputs></ModelStructure>
</fmiModelDescription>
"#;

/// The FMU of `integrator.c` with traits, and the directory with its record: a file to which the FMU writes when an
/// instance is created, reset or freed.
pub struct Recorded {
    pub fmu: Option<System>,
    directory: TempDir,
}

impl Recorded {
    /// Builds and opens the FMU with these traits and with an attribute that is added to its element CoSimulation.
    pub fn open(traits: &str, attribute: &str) -> Self {
        let directory = tempfile::tempdir().unwrap();
        let guid = format!("{{{traits}:{}}}", directory.path().join("record").display());
        let xml = DESCRIPTION
            .replace("GUID", &guid)
            .replace("<CoSimulation", &format!("<CoSimulation {attribute}"));
        let path = pack(directory.path(), ("integrator", 2), &xml, &library("integrator", &[]), &[]);
        // SAFETY: the FMU of these tests.
        let fmu = unsafe { Fmu::open(&path) }.unwrap().system().clone();
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
