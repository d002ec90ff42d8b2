import numpy as np
from fmpy import simulate_fmu

t = np.linspace(0, 2, 2001)
motors = np.array(list(zip(t, np.sin(t), -np.sin(t), np.cos(t), -np.cos(t))),
                  dtype=[(name, float) for name in ("time", "theta1", "theta2", "omega1", "omega2")])
result = simulate_fmu("prw_testbed.fmu", fmi_type="CoSimulation", stop_time=2, output_interval=1e-3,
                      input=motors, start_values={"use_omega": True},
                      output=["pitch", "roll", "tau1", "tau2"])
print(result["roll"][-1])
