from math import degrees

from fmpy import read_model_description
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimObserver import CosimObserver

variables = read_model_description("prw_closed_loop/prw_testbed.fmu").modelVariables
reference = {variable.name: variable.valueReference for variable in variables}
log_output_level(CosimLogLevel.WARNING)
execution = CosimExecution.from_osp_config_file("prw_closed_loop")
testbed = execution.slave_index_from_instance_name("testbed")
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
for k in range(1000):
    execution.step()
pitch, roll = observer.last_real_values(testbed, [reference["pitch"], reference["roll"]])
print(degrees(pitch), degrees(roll))
