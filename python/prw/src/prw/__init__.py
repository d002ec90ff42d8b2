"""The pitch-roll wrist testbed in Python: simulate it, read recordings of it, find its parameters in them, linearize
it, run it with thousands of parameter sets, animate it, and compare results of other tools with a reference::

    import prw

    run = prw.simulate("motors.csv", {"k1": 100.0})  # by default the paper's experiment
    run["roll"]  # (n,) rad, at run.time

These functions are public; the modules of this package are internal:

* ``simulate``, ``read``, ``animate``, ``sweep``: runs and recordings
* ``identify``, ``excite``: parameters from measurements, and motions to measure with
* ``linearize``, ``Linearizer``: linear models
* ``sensitivities``: derivatives of a simulation with respect to parameters
* ``check``: another tool's results against a reference
* ``default_fmu``: the path of the FMU

Everything is in SI (s, rad, rad/s, N.m, kg.m2), except that a linear model has the units of its FMU. Functions write files
only to paths that they are given, and print only the progress of long work at a Python prompt or in a notebook. An error
that the caller can fix is a `prw.UserError`; its message names the cause and, if it is not obvious, the remedy.
"""

# __init__.pyi lists the module of each name, which is imported at the first use, so that `import prw` is fast. No module
# of this package may have the name of a function there, such as `identify`: once imported, it would replace the function.
# lazy_loader is imported at the first use, too, because an interrupt before the command `prw` can catch it shows a traceback.


def __getattr__(name):
    import lazy_loader

    module = globals()
    module["__getattr__"], module["__dir__"], module["__all__"] = lazy_loader.attach_stub(__name__, __file__)
    return module["__all__"] if name == "__all__" else module["__getattr__"](name)


def __dir__():
    return sorted(__getattr__("__all__"))
