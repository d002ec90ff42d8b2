import math
from fmpy import read_model_description
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

variables = read_model_description("prw_testbed.fmu").modelVariables
reference = {variable.name: variable.valueReference for variable in variables}
log_output_level(CosimLogLevel.WARNING)
step = 1_000_000  # ns
execution = CosimExecution.from_step_size(step)
slave = CosimLocalSlave(fmu_path="prw_testbed.fmu", instance_name="testbed")
testbed = execution.add_local_slave(slave)
motors = CosimManipulator.create_override()
execution.add_manipulator(motors)
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
for k in range(2000):
    theta = math.sin(k * step * 1e-9)
    motors.slave_real_values(testbed, [reference["theta1"], reference["theta2"]], [theta, -theta])
    execution.step()
print(observer.last_real_values(testbed, [reference["pitch"], reference["roll"]]))
