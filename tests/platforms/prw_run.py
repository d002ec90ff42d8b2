"""Simulates a recording with the installed prw and the FMU in it, and prints every tenth number of each output.

A motion that was calculated would differ in its last digit: the sines of other systems do.
"""

import sys

import prw

for name, values in prw.simulate(sys.argv[1]).items():
    print(name, *(repr(float(value)) for value in values[::10]))
