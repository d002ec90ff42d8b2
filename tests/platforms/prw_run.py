"""Simulates Fig. 4 with the installed prw and the FMU in it, and prints every tenth number of each output."""

import prw

for name, values in prw.simulate().items():
    print(name, *(repr(float(value)) for value in values[::10]))
