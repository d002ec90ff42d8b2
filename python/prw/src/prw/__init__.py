"""The pitch-roll wrist testbed in Python: simulate it, read recordings of it, find its parameters in them, linearize it,
run it with thousands of parameter sets, show it moving, compare what other tools make of it with a reference.

    import prw

    run = prw.simulate("motors.csv", {"k1": 100.0})  # or a prw.Motion; by default the paper's experiment
    run["roll"]  # (n,) rad, at run.time

What there is to call; the modules of this package are its inside:

    simulate, read, animate, sweep     runs and recordings
    identify, excite                   parameters from measurements, and motions to measure with
    linearize, Linearizer              linear models
    check                              another tool's results against a reference
    default_fmu                        the path of the FMU

Everything is in SI (s, rad, rad/s, N.m, kg.m2). Nothing writes a file unless it is told where, and nothing prints but the progress
of long work at a Python prompt or in a notebook. What the caller can put right is a `prw.UserError`, whose text says what is wrong
and what to do.
"""

import lazy_loader

# __init__.pyi says where each name is. It is loaded when it is first used, so that `import prw` takes no time. No module
# or package in this folder may be called like a name there (as `identify` is): once imported, it would be in its place.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
