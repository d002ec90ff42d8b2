//! Invalid parameters are rejected with one message that contains the reason, and change nothing. The tests of fmu-export
//! cover rejections that do not depend on the model.

use crate::{TABLE, in_mode, vr};
use fmu_export::Interface::CoSimulation;
use fmu_export::Mode::*;
use fmu_export::{Attributes, Causality};
use fmu_test_kit::Either;
use prw_testbed::BUILT_IN;
use prw_testbed::variables::Name;

/// Checks for each parameter with a declared minimum that a simulation with the minimum runs, and that smaller values are
/// rejected.
#[test]
fn declared_minima_are_the_limits() {
    let mut found = 0;
    for (index, variable) in (0..).zip(TABLE).filter(|(_, of)| of.causality() == Causality::Parameter) {
        let fmu = in_mode(CoSimulation, Instantiated);
        match variable.variable_type().attributes {
            Attributes::Real { min: Some(min), .. } => {
                let below = if min == 0.0 { -1e-300 } else { 0.999 * min };
                fmu.rejected_with(&[variable.name()], |fmu| fmu.try_set(&[index], &[below]));
                fmu.set(&[index], &[min]);
            }
            Attributes::Integer { min, .. } => {
                let min = i32::try_from(min).unwrap();
                fmu.rejected_with(&[variable.name()], |fmu| fmu.set_integer(index, min - 1));
                fmu.ok(fmu.set_integer(index, min));
            }
            _ => continue,
        }
        fmu.initialize(0.0);
        fmu.step(0.0, 0.01);
        fmu.set(&[vr(Name::theta1)], &[0.3]);
        fmu.step(0.01, 0.01);
        let [torque, pitch] = fmu.get([vr(Name::tau1), vr(Name::pitch)]);
        assert!(torque != 0.0 && pitch != 0.0, "{}: {torque} {pitch}", variable.name());
        found += 1;
    }
    assert_eq!(found, BUILT_IN.start_values().len(), "every parameter of Table 1 must have a minimum");
}

/// Checks that one of c1 and c2 may be 0 but not both, in either order of setting them, and that parameters are rejected if
/// a coefficient of the equations overflows.
#[test]
fn combinations_of_parameters_are_checked() {
    let fmu = in_mode(CoSimulation, Instantiated);
    for (zero, other) in [(vr(Name::c1), vr(Name::c2)), (vr(Name::c2), vr(Name::c1))] {
        fmu.set(&[zero], &[0.0]);
        fmu.rejected_with(&["c1 and c2"], |fmu| fmu.try_set(&[other], &[0.0]));
        fmu.set(&[zero], &[0.1]);
    }
    let fmu = in_mode(CoSimulation, StepComplete);
    fmu.rejected_with(&["too far apart"], |fmu| {
        fmu.try_set(&[vr(Name::k1), vr(Name::c1), vr(Name::c2)], &[1e300, 1e-300, 0.0])
    });
}
