"""Steps the testbed FMU under libcosim through a table of inputs; run by test_libcosim.py.

Arguments: FMU, step in ns, inputs (.npy, (n, 4): theta1, theta2, omega1, omega2), result (.npy to write), then the
value references of the four inputs, of use_omega and of the outputs to record after each step.
"""

import sys

import numpy as np
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave


def main(fmu, step, inputs, result, *references):
    references = [int(r) for r in references]
    set_references, use_omega, outputs = references[:4], references[4], references[5:]
    log_output_level(CosimLogLevel.WARNING)
    execution = CosimExecution.from_step_size(int(step))
    # Kept in variables: libcosimpy destroys what Python lets go.
    slave = CosimLocalSlave(fmu_path=fmu, instance_name="testbed")
    index = execution.add_local_slave(slave)
    if index < 0:
        sys.exit("libcosim does not take the FMU")
    execution.boolean_initial_value(index, use_omega, True)
    override = CosimManipulator.create_override()
    execution.add_manipulator(override)
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    table = np.load(inputs)
    recorded = np.empty((len(table) - 1, len(outputs)))
    for k, row in enumerate(table[:-1]):
        override.slave_real_values(index, set_references, list(row))
        if not execution.step():
            sys.exit(f"libcosim stopped at step {k}")
        recorded[k] = observer.last_real_values(index, outputs)
    np.save(result, recorded)


if __name__ == "__main__":
    main(*sys.argv[1:])
