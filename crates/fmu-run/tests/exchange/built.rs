//! Packs the FMUs of `equations.c`.

use fmu_run::{Fmu, Standard, System};
use fmu_test_kit::c_models::{library, pack};

/// Returns the numbers of states and of event indicators.
fn sizes(model: &str) -> (usize, usize) {
    let states = match model {
        "stair" | "wave" => 0,
        "ball" | "zeno" | "vanderpol" => 2,
        _ => 1,
    };
    (states, usize::from(["ball", "zeno", "relay", "ending", "zero", "wave"].contains(&model)))
}

fn description2(model: &str, attributes: &str) -> String {
    let (states, indicators) = sizes(model);
    let state = |k: usize| {
        format!(
            "<ScalarVariable name=\"x{k}\" valueReference=\"{}\" causality=\"local\"><Real/></ScalarVariable>\
             <ScalarVariable name=\"der(x{k})\" valueReference=\"{}\" causality=\"local\"><Real derivative=\"{}\"/></ScalarVariable>",
            8 + k,
            10 + k,
            8 + 2 * k
        )
    };
    let all: String = (0..states).map(state).collect();
    let derivatives: String = (0..states).map(|k| format!("<Unknown index=\"{}\"/>", 9 + 2 * k)).collect();
    format!(
        r#"<fmiModelDescription fmiVersion="2.0" modelName="{model}" guid="{{{model}}}" numberOfEventIndicators="{indicators}">
        <ModelExchange modelIdentifier="equations" {attributes}/>
        <ModelVariables>
        <ScalarVariable name="u" valueReference="1" causality="input" variability="continuous"><Real start="0"/></ScalarVariable>
        <ScalarVariable name="w" valueReference="2" causality="input" variability="continuous"><Real start="0" derivative="1"/></ScalarVariable>
        <ScalarVariable name="n" valueReference="3" causality="input" variability="discrete"><Integer start="0"/></ScalarVariable>
        <ScalarVariable name="p" valueReference="4" causality="parameter" variability="fixed"><Real start="1"/></ScalarVariable>
        <ScalarVariable name="y" valueReference="5" causality="output" variability="continuous"><Real/></ScalarVariable>
        <ScalarVariable name="rate" valueReference="6" causality="output" variability="continuous"><Real/></ScalarVariable>
        <ScalarVariable name="hits" valueReference="7" causality="output" variability="discrete"><Integer/></ScalarVariable>
        {all}</ModelVariables>
        <ModelStructure><Outputs><Unknown index="5"/><Unknown index="6"/><Unknown index="7"/></Outputs>
        <Derivatives>{derivatives}</Derivatives></ModelStructure></fmiModelDescription>"#
    )
}

fn description3(model: &str, attributes: &str) -> String {
    let (states, indicators) = sizes(model);
    let state = |k: usize| {
        format!(
            "<Float64 name=\"x{k}\" valueReference=\"{}\" causality=\"local\"/>\
             <Float64 name=\"der(x{k})\" valueReference=\"{}\" causality=\"local\" derivative=\"{}\"/>",
            8 + k,
            10 + k,
            8 + k
        )
    };
    let all: String = (0..states).map(state).collect();
    let derivatives: String =
        (0..states).map(|k| format!("<ContinuousStateDerivative valueReference=\"{}\"/>", 10 + k)).collect();
    let indicator = if states == 0 { 5 } else { 8 };
    let indicators = format!("<EventIndicator valueReference=\"{indicator}\"/>").repeat(indicators);
    format!(
        r#"<fmiModelDescription fmiVersion="3.0" modelName="{model}" instantiationToken="{{{model}}}">
        <ModelExchange modelIdentifier="equations" needsCompletedIntegratorStep="true" {attributes}/>
        <ModelVariables>
        <Float64 name="u" valueReference="1" causality="input" start="0"/>
        <Float64 name="w" valueReference="2" causality="input" start="0" derivative="1"/>
        <Int32 name="n" valueReference="3" causality="input" start="0"/>
        <Float64 name="p" valueReference="4" causality="parameter" variability="fixed" start="1"/>
        <Float64 name="y" valueReference="5" causality="output"/>
        <Float64 name="rate" valueReference="6" causality="output"/>
        <Int32 name="hits" valueReference="7" causality="output"/>
        {all}</ModelVariables>
        <ModelStructure><Output valueReference="5"/><Output valueReference="6"/><Output valueReference="7"/>
        {derivatives}{indicators}</ModelStructure></fmiModelDescription>"#
    )
}

/// Opens a model.
pub fn opened(model: &str, standard: Standard) -> System {
    opened_with(model, standard, "")
}

/// Opens a model and adds attributes to its element ModelExchange.
pub fn opened_with(model: &str, standard: Standard, attributes: &str) -> System {
    let (xml, fmi) = match standard {
        Standard::Fmi2 => (description2(model, attributes), 2),
        Standard::Fmi3 => (description3(model, attributes), 3),
    };
    let directory = tempfile::tempdir().unwrap();
    let path = pack(directory.path(), ("equations", fmi), &xml, &library("equations", &[]), &[]);
    // SAFETY: the FMU of these tests.
    unsafe { Fmu::open(&path) }.unwrap().system().clone()
}
