from math import degrees, radians

from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import Parameter, ParameterSet

# FMPy leaves the values in the SSP to its caller.
start = ParameterSet(parameters=[Parameter(name="testbed.use_omega", value=True)])
go_to = {"pitch_ref": lambda time: radians(30), "roll_ref": lambda time: radians(60)}
result = simulate_ssp("prw_closed_loop.ssp", stop_time=1, step_size=1e-3, parameter_set=start, input=go_to)
print(degrees(result["testbed.pitch"][-1]), degrees(result["testbed.roll"][-1]))
