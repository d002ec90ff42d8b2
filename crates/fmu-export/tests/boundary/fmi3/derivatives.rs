//! Partial derivatives, derivatives of outputs, and dependencies.

use crate::models::oscillator::Name::{self, *};
use crate::models::{Oscillator, Sum};
use fmu_export::Interface::*;
use fmu_export::Variables;
use fmu_export::fmi3::reference;
use fmu_test_kit::Either;
use fmu_test_kit::fmi3::Importer;

const UNKNOWNS: [Name; 5] = [position, der_position, der_velocity, spring_force, energy];
const KNOWNS: [Name; 3] = [force, position, velocity];

fn moving() -> Importer {
    let fmu = Importer::of::<Oscillator>(ModelExchange);
    fmu.set(&[position as u32, velocity as u32], &[0.25, -3.0]);
    fmu.initialize(0.0);
    fmu
}

/// Checks that the adjoint derivative is the transpose of the directional one, bit-identical.
#[test]
fn adjoint_is_transposed() {
    let fmu = moving();
    for unknown in UNKNOWNS.map(|name| reference(name as u32)) {
        for known in KNOWNS.map(|name| reference(name as u32)) {
            let (mut forward, mut adjoint) = (f64::NAN, f64::NAN);
            fmu.ok(fmu.fmi3GetDirectionalDerivative(&unknown, 1, &known, 1, &1.0, 1, &mut forward, 1));
            fmu.ok(fmu.fmi3GetAdjointDerivative(&unknown, 1, &known, 1, &1.0, 1, &mut adjoint, 1));
            assert_eq!(forward.to_bits(), adjoint.to_bits());
        }
    }
    // Checks all at once: seeds that are powers of two add up without rounding.
    let (unknowns, knowns) =
        (UNKNOWNS.map(|name| reference(name as u32)), KNOWNS.map(|name| reference(name as u32)));
    let (rows, columns) = ([1.0, 2.0, -4.0, 0.5, 0.25], [1.0, -2.0, 8.0]);
    let (mut forward, mut adjoint) = ([f64::NAN; 5], [f64::NAN; 3]);
    let (u, k) = (unknowns.as_ptr(), knowns.as_ptr());
    fmu.ok(fmu.fmi3GetDirectionalDerivative(u, 5, k, 3, columns.as_ptr(), 3, forward.as_mut_ptr(), 5));
    fmu.ok(fmu.fmi3GetAdjointDerivative(u, 5, k, 3, rows.as_ptr(), 5, adjoint.as_mut_ptr(), 3));
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let (one, other) = (product(&rows, &forward), product(&adjoint, &columns));
    assert!((one - other).abs() < 1e-12 * one.abs(), "{one} {other}");
}

#[test]
fn lengths_and_kinds() {
    let fmu = moving();
    let (u, k, mut out) = (reference(energy as u32), reference(position as u32), 0.0);
    fmu.refused("seeds", |fmu| fmu.fmi3GetDirectionalDerivative(&u, 1, &k, 1, &1.0, 0, &mut out, 1));
    fmu.refused("results", |fmu| fmu.fmi3GetDirectionalDerivative(&u, 1, &k, 1, &1.0, 1, &mut out, 0));
    fmu.refused("seeds", |fmu| fmu.fmi3GetAdjointDerivative(&u, 1, &k, 0, &1.0, 0, &mut out, 0));
    fmu.refused("no known", |fmu| fmu.fmi3GetAdjointDerivative(&u, 1, &u, 1, &1.0, 1, &mut out, 1));
    fmu.refused("no seed", |fmu| fmu.fmi3GetAdjointDerivative(&u, 1, &k, 1, &f64::NAN, 1, &mut out, 1));
    let sum = Importer::of::<Sum>(CoSimulation);
    sum.initialize(0.0);
    sum.refused_with(&["providesAdjointDerivatives is false"], |fmu| {
        fmu.fmi3GetAdjointDerivative(&1, 1, &0, 1, &1.0, 1, &mut out, 1)
    });
}

/// Checks derivatives with respect to parameters, which may be set at any time.
#[test]
fn with_respect_to_parameters() {
    let fmu = moving();
    let (u, mut forward, mut adjoint) = (reference(spring_force as u32), f64::NAN, f64::NAN);
    let k = reference(stiffness as u32);
    fmu.ok(fmu.fmi3GetDirectionalDerivative(&u, 1, &k, 1, &2.0, 1, &mut forward, 1));
    fmu.ok(fmu.fmi3GetAdjointDerivative(&u, 1, &k, 1, &2.0, 1, &mut adjoint, 1));
    assert_eq!((forward, adjoint), (-0.5, -0.5), "force = -stiffness springs position");
    let k = reference(springs as u32);
    fmu.refused("Int32", |fmu| fmu.fmi3GetDirectionalDerivative(&u, 1, &k, 1, &1.0, 1, &mut forward, 1));
}

#[test]
fn of_outputs() {
    let fmu = Importer::of::<Oscillator>(CoSimulation);
    fmu.set(&[position as u32, velocity as u32], &[0.25, -3.0]);
    fmu.initialize(0.0);
    let time = reference(Oscillator::TABLE.len() as u32);
    let (vr, mut values) = ([reference(position as u32), time], [f64::NAN; 2]);
    fmu.ok(fmu.fmi3GetOutputDerivatives(vr.as_ptr(), 2, [1, 1].as_ptr(), values.as_mut_ptr(), 2));
    assert_eq!(values, [-3.0, 1.0]);
    fmu.refused("order 0", |fmu| fmu.fmi3GetOutputDerivatives(&time, 1, &0, &mut 0.0, 1));
    // Section 4.4.1 allows orders up to maxOutputDerivativeOrder.
    for orders in [[1, 2], [2, 1], [1, i32::MAX]] {
        fmu.refused_with(&["must be at most 1 (maxOutputDerivativeOrder)"], |fmu| {
            fmu.fmi3GetOutputDerivatives(vr.as_ptr(), 2, orders.as_ptr(), values.as_mut_ptr(), 2)
        });
    }
}

/// Checks that no function returns dependencies; the description contains them.
#[test]
fn dependencies_are_in_the_description_alone() {
    let fmu = moving();
    let mut count = 0;
    fmu.refused_with(&["providesPerElementDependencies is false"], |fmu| {
        fmu.fmi3GetNumberOfVariableDependencies(0, &mut count)
    });
}
