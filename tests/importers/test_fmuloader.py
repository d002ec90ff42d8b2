"""fmuloader, which loads the library of an FMU and passes on its functions: steps, states and resets in both FMI versions."""

from __future__ import annotations

import contextlib

import fmpy
import numpy as np
from built import needed
from lagrange import OUTPUTS, linear_model, table_1
from reference import follow

needed("fmuloader", "fmuloader")

from fmuloader.fmi2 import Fmi2Slave, Fmi2Type  # noqa: E402
from fmuloader.fmi3 import Fmi3Slave  # noqa: E402

STEP, STEPS = 1e-3, 400
INPUTS = ("theta1", "theta2", "omega1", "omega2")


@contextlib.contextmanager
def loaded(fmu, version):
    """Yields an instance in Co-Simulation and the value references by name."""
    description = fmpy.read_model_description(str(fmu))
    references = {variable.name: variable.valueReference for variable in description.modelVariables}
    with (Fmi3Slave if version else Fmi2Slave)(fmu, model_identifier=description.coSimulation.modelIdentifier) as one:
        if version:
            one.instantiate_co_simulation("one", instantiation_token=description.guid)
            one.get_real, one.set_real = one.get_float64, one.set_float64
        else:
            one.instantiate("one", Fmi2Type.CO_SIMULATION, guid=description.guid)
        yield one, references
        one.terminate()


def simulate(one, references, theta, slope, steps):
    """Returns the outputs (len(steps), 8) at the ends of these steps, with motors at theta + slope t."""
    rows = []
    for k in steps:
        one.set_real([references[name] for name in INPUTS], [*(theta + slope * k * STEP), *slope])
        one.do_step(k * STEP, STEP, False)
        rows.append(one.get_real([references[name] for name in OUTPUTS]))
    return np.array(rows)


def test_steps_states_and_resets(testbed, version, stated):
    """The motors turn at constant rates. A step of size 0 at the start has no effect."""
    theta, slope, half = np.array([0.3, -0.2]), np.array([0.4, 1.1]), STEPS // 2
    with loaded(testbed, version) as (one, references):

        def begin() -> None:
            if not version:
                one.setup_experiment(start_time=0.0)
            one.set_boolean([references["use_omega"]], [True])
            one.set_real([references[name] for name in INPUTS], [*theta, *slope])
            one.enter_initialization_mode()
            one.exit_initialization_mode()

        begin()
        one.do_step(0.0, 0.0, False)
        first = simulate(one, references, theta, slope, range(half))
        state = one.get_fmu_state()
        second = simulate(one, references, theta, slope, range(half, STEPS))
        one.set_fmu_state(one.deserialize_fmu_state(one.serialize_fmu_state(state)))
        again = simulate(one, references, theta, slope, range(half, STEPS))
        one.free_fmu_state(state)
        one.reset()
        begin()
        rerun = simulate(one, references, theta, slope, range(STEPS))
    found = np.concatenate([first, second])
    assert np.array_equal(again, second) and np.array_equal(rerun, found)
    time = np.arange(STEPS + 1) * STEP
    _, after = follow(linear_model(table_1()), time, theta + slope * time[:, None], np.tile(slope, (STEPS + 1, 1)))
    expected = np.column_stack([after[name] for name in OUTPUTS])
    worst = np.max(np.abs(found - expected) / np.abs(expected).max(axis=0))
    assert worst < 1e-12
    stated("fmuloader", "fmuloader", "CS: 1e-12; a restored state and a reset are bit-identical")
