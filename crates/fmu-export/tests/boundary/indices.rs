//! Reals in every kind of field, accessed one at a time and in groups. The fast implementations for some fields and
//! counts must agree with the general one.

use crate::models::{Meter, meter::Name};
use fmu_export::Interface::CoSimulation;
use fmu_export::Status;
use fmu_test_kit::{Either, Importer, fmi3};

const INPUTS: [Name; 6] = [Name::plain, Name::first, Name::second, Name::boxed, Name::listed, Name::moving];
const TOTAL: u32 = Name::total as u32;
const SUM: u32 = Name::sum as u32;
const LEVEL: u32 = Name::level as u32;

/// Sets and reads `count` inputs per call, before the first step and between steps. Each input comes first in two of the
/// calls. Asserts that all inputs have the values that were set, and that each setter had its side effect.
fn set_and_read<F: Either>(count: usize) {
    let fmu = F::new::<Meter>(CoSimulation);
    fmu.initialize(0.0);
    let (mut now, mut time, mut number) = ([0.0; 6], 0.0, 0.0);
    let mut seconds = 0;
    for round in 0..12 {
        let indices: Vec<usize> = (round..round + count).map(|index| index % 6).collect();
        let vr: Vec<u32> = indices.iter().map(|index| INPUTS[*index] as u32).collect();
        for index in &indices {
            number += 1.0;
            now[*index] = number;
        }
        fmu.set(&vr, &indices.iter().map(|index| now[*index]).collect::<Vec<_>>());
        assert_eq!(fmu.read(&vr), indices.iter().map(|index| now[*index]).collect::<Vec<_>>());
        assert_eq!(fmu.get(INPUTS.map(|name| name as u32)), now);
        assert_eq!(fmu.get([TOTAL, SUM]), [now.iter().sum(); 2]);
        seconds += i32::from(indices.contains(&2));
        let marks = [1, 2, 3].iter().filter(|index| indices.contains(index)).count() as i32;
        assert_eq!(fmu.integer(Name::marks as u32), 10 * seconds + marks, "{indices:?}");
        if round == 0 {
            assert_eq!(fmu.get([LEVEL]), [now[0]], "the level must start at rest");
        }
        // The model makes steps of size 0.5 with a later calculation, of size 2 without one, and of size 1 with `step_fast`.
        let size = [0.5, 2.0, 1.0][round % 3];
        fmu.step(time, size);
        time += size;
        // Each step exchanges the two values of the ring, so `moving` has the value from two steps ago, or 0.
        assert_eq!(fmu.get([TOTAL]), fmu.get([SUM]));
        now[5] = fmu.get([Name::moving as u32])[0];
        assert_eq!(fmu.integer(Name::marks as u32), 10 * seconds);
    }
    assert_eq!(fmu.integer(Name::fast_steps as u32), 4);
}

#[test]
fn single_and_several() {
    for count in 1..=6 {
        set_and_read::<Importer>(count);
        set_and_read::<fmi3::Importer>(count);
    }
}

/// Checks that a rejected variable at any index changes neither the model nor the importer's array.
fn rejected<F: Either>() {
    let fmu = F::new::<Meter>(CoSimulation);
    fmu.initialize(0.0);
    for round in 0..3 {
        let before = fmu.bytes();
        for wrong in [TOTAL, Name::marks as u32, 99, u32::MAX] {
            for vr in [vec![wrong], vec![0, wrong], vec![wrong, 0], vec![0, 1, 2, wrong]] {
                fmu.rejected("set", |fmu| fmu.try_set(&vr, &vec![7.0; vr.len()]));
                if wrong != TOTAL {
                    let mut values = vec![-1.0; vr.len()];
                    fmu.rejected("get", |fmu| fmu.try_get(&vr, &mut values));
                    assert_eq!(values, vec![-1.0; vr.len()]);
                }
            }
        }
        for value in [f64::NAN, f64::INFINITY] {
            fmu.rejected("no number", |fmu| fmu.try_set(&[0, 1], &[7.0, value]));
        }
        assert_eq!(fmu.bytes(), before);
        fmu.step(f64::from(round), 1.0);
    }
    // Each value is finite, but the sum of both is not.
    fmu.set(&[0, 1], &[f64::MAX, f64::MAX]);
    assert_eq!(fmu.get([0, 1]), [f64::MAX; 2]);
    fmu.rejected_with(&["total is not a finite number"], |fmu| fmu.try_get(&[TOTAL, 0, 1, 2], &mut [0.0; 4]));
    assert_eq!(fmu.try_step(3.0, 1.0), Status::Ok);
}

#[test]
fn invalid_variables_and_values() {
    rejected::<Importer>();
    rejected::<fmi3::Importer>();
}

/// A model with arrays as long as in a discretized partial differential equation.
mod long {
    use fmu_export::*;

    variables! {
        pub struct Long;
        /// Source
        heat: [f64; 1500] = input(&NUMBER).start([0.0; 1500]);
        /// State
        field: [f64; 1500] = output(&NUMBER).state().start([0.0; 1500]);
        /// Values on a grid
        grid: [[f64; 12]; 101] = local(&NUMBER).state().start([[0.0; 12]; 101]);
        /// Its rate
        der_grid as "der(grid)" = local(&NUMBER).derivative_of(grid) by |long| long.grid;
        /// Its rate
        der_field as "der(field)" = local(&NUMBER).derivative_of(field) by |long| long.heat;
    }
}

#[test]
fn long_arrays_have_names_states_and_derivatives() {
    use fmu_export::Variables;
    let table = long::Long::TABLE;
    let mut expected: Vec<String> = ["heat", "field"]
        .iter()
        .flat_map(|name| (1..=1500).map(move |index| format!("{name}[{index}]")))
        .collect();
    let grid = |end: &'static str| {
        (1..=101).flat_map(move |row| (1..=12).map(move |column| format!("grid[{row},{column}]{end}")))
    };
    expected.extend(grid(""));
    expected.extend(grid(")").map(|name| format!("der({name}")));
    expected.extend((1..=1500).map(|index| format!("der(field[{index}])")));
    assert!(table.iter().map(|variable| variable.name()).eq(&expected));
    assert_eq!(long::Long::STATES.len(), 1500 + 1212);
    for state in long::Long::STATES {
        let [state, derivative] = [state.state, state.derivative].map(|index| &table[index as usize]);
        assert_eq!(derivative.name(), format!("der({})", state.name()));
        assert_eq!(derivative.differentiates().map(|index| table[index as usize].name()), Some(state.name()));
    }
}
