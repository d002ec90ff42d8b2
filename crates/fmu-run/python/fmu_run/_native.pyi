from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

class FmuError(Exception):
    """An FMU that cannot be loaded or run, or refuses a run."""

class Fmu:
    def __init__(self, path: str, execution_tool: bool) -> None: ...
    def close(self) -> None: ...
    def about(self) -> tuple[str, str, str, bool]: ...
    def variables(self) -> list[tuple[str, str, str, str | None, str | None, str | None, str]]: ...
    def run(
        self,
        time: NDArray[np.float64],
        inputs: list[tuple[str, float | NDArray[np.float64]]],
        input_derivatives: list[tuple[str, float | NDArray[np.float64]]],
        start: list[tuple[str, float | str | NDArray[np.float64]]],
        outputs: list[str],
        every: int | None,
        measures: list[Any],
        threads: int | None,
        read_before_set: bool,
        progress: Callable[[int, int], Any] | None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], list[tuple[int, str]], list[tuple[int, str]]]: ...
