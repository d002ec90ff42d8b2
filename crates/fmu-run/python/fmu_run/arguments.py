"""Types of the arguments of `Fmu` and `System`."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from typing import Any, Literal

from numpy.typing import ArrayLike

#: A statistic of an output, as described in `Fmu.run`.
Measure = Literal["min", "max", "peak", "time_of_peak", "mean", "rms", "end"]
#: Interface type of FMI. The spellings with a hyphen and with an underscore have the same meaning.
Interface = Literal["co-simulation", "model-exchange", "co_simulation", "model_exchange"]
#: Method for integrating an FMU in Model Exchange, as described in `Fmu.run`.
Solver = Literal["auto", "dopri5", "dop853", "bdf", "rk4"]
#: A start value: one for all runs or instances, or one for each run or instance. A string is the value of a String variable, the name
#: of an item of an enumeration, or "true" or "false" for a Boolean. In a pair (values, unit), the values are converted from this unit,
#: which must be the unit or a display unit of the variable.
Start = ArrayLike | str | Sequence[str] | tuple[ArrayLike, str]
#: Values of an input: one for all times or one for each communication point, as values or (values, unit); at other times, (times, values)
#: or (times, values, unit).
Trajectory = ArrayLike | tuple[ArrayLike, str] | tuple[ArrayLike, ArrayLike] | tuple[ArrayLike, ArrayLike, str]
#: Receiver of messages of the FMU: a logger, or a function that is called with the index of the run or instance (None if it is unknown),
#: the status, the category and the message.
Log = Callable[[int | None, str, str, str], Any] | logging.Logger
