"""A single FMU."""

from __future__ import annotations

import os

from fmu_run._native import Loaded
from fmu_run.model import Model


class Fmu(Model):
    """An FMU, unpacked and loaded once. As a context manager, it unloads the FMU at the end of the block or, if instances still exist
    then, when the last one is freed.

    The library of the FMU runs in this process, so a crash of the FMU ends the process.

    Parameters
    ----------
    path
        Path of an FMU, or of a directory with an unpacked FMU.
    execution_tool
        Run the FMU even if its library starts another program (needsExecutionTool), which must be installed.

    Raises
    ------
    FmuError
        If the file is not an FMU, has no library for this platform, or needs another program although `execution_tool` is false.
    """

    def __init__(self, path: str | os.PathLike[str], *, execution_tool: bool = False):
        super().__init__(Loaded(path, execution_tool))
        version, model_name, token, derivatives, outputs, directional, units = self._loaded.about()
        #: str: FMI version, "2.0" or "3.0".
        self.fmi_version = version
        #: str: name of the model.
        self.model_name = model_name
        #: str: guid (FMI 2.0) or instantiation token (FMI 3.0).
        self.token = token
        #: dict[str, str]: name of the time derivative of each continuous state, by the name of the state, in the order of the model
        #: structure.
        self.derivatives = dict(derivatives)
        #: tuple[str, ...]: names of the floating-point outputs, in the order of the model structure.
        self.outputs = tuple(outputs)
        #: dict[str, bool]: whether the FMU has directional derivatives, by interface type.
        self.directional = dict(directional)
        self._interfaces = self.directional.keys()
        #: dict[str, dict[str, str]]: attributes of the base unit (exponents, factor and offset, as strings), by the name of the unit.
        self.units = {name: dict(attributes) for name, attributes in units.items()}

    def __repr__(self) -> str:
        closed = ", closed" if self._loaded.is_closed() else ""
        return f"<Fmu {self.model_name}, FMI {self.fmi_version}, {len(self.variables)} variables{closed}>"
