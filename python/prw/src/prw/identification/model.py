"""The testbed FMU for identification: its parameters, and its linear model at any parameters."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import NamedTuple
from xml.etree import ElementTree

import fmu_run

from prw.columns import CHANNELS
from prw.linearization import Linearizer
from prw.testbed import CONTINUOUS

SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"


class Parameter(NamedTuple):
    """A parameter of the model description.

    Attributes
    ----------
    start
        Start value, SI.
    unit
        SI unit.
    shown
        Display unit.
    factor
        Factor from the display unit to SI.
    meaning
        Description.
    """

    start: float
    unit: str
    shown: str
    factor: float
    meaning: str


class Parameters:
    """The numeric parameters that the model description of the testbed declares, without the initial states.

    Attributes
    ----------
    real, counts
        The Real and the Integer parameters by name.
    guid
        Guid of the FMU, a hash of its sources and start values.
    """

    def __init__(self, fmu: fmu_run.Fmu):
        self.guid: str = fmu.token
        self.real: dict[str, Parameter] = {}
        self.counts: dict[str, Parameter] = {}
        self._units = fmu.units
        for v in fmu.variables.values():
            unit, start = v.unit or "", v.start or "0"
            # Initial states belong to a run, not to the testbed.
            if v.causality == "parameter" and v.type in CONTINUOUS and not v.name.endswith("_start"):
                shown = v.display_unit or unit
                factor = float(fmu.converted(v.name, 1.0, shown)) if v.display_unit else 1.0
                self.real[v.name] = Parameter(float(start), unit, shown, factor, v.description)
            elif v.causality == "parameter" and "Int" in v.type:
                self.counts[v.name] = Parameter(int(start), "", "1", 1.0, v.description)

    @property
    def starts(self) -> dict[str, float]:
        """Start values of the Real parameters in SI, by name."""
        return {name: parameter.start for name, parameter in self.real.items()}

    def for_building(self, values: Mapping[str, float]) -> str:
        """All parameters in the format of modelDescription/parameters.json, for `build_fmu --parameters`. `values` of the Real
        ones are in SI and are written in their display units; Integers have their start values."""
        lines = []
        for name, parameter in {**self.real, **self.counts}.items():
            value = values[name] / parameter.factor if name in self.real else parameter.start
            entry = {"value": value, "unit": parameter.shown, "meaning": parameter.meaning}
            lines.append(f"  {json.dumps(name)}: {json.dumps(entry, ensure_ascii=False)}")
        return "{\n" + ",\n".join(lines) + "\n}\n"

    def ssv(self, values: Mapping[str, float], title: str) -> str:
        """All parameters as a parameter set of SSP 1.0 in SI, with the units' definitions. Integers have their start values."""
        for prefix, space in (("ssv", SSV), ("ssc", SSC)):
            ElementTree.register_namespace(prefix, space)
        root = ElementTree.Element(f"{{{SSV}}}ParameterSet", version="1.0", name=title)
        parameters = ElementTree.SubElement(root, f"{{{SSV}}}Parameters")
        for name, parameter in {**self.real, **self.counts}.items():
            element = ElementTree.SubElement(parameters, f"{{{SSV}}}Parameter", name=name)
            if name in self.real:
                value = {"value": repr(float(values[name])), "unit": parameter.unit}
                ElementTree.SubElement(element, f"{{{SSV}}}Real", value)
            else:
                ElementTree.SubElement(element, f"{{{SSV}}}Integer", value=str(parameter.start))
        units, used = ElementTree.SubElement(root, f"{{{SSV}}}Units"), {p.unit for p in self.real.values()}
        for name, unit in self._units.items():
            if name in used:
                element = ElementTree.SubElement(units, f"{{{SSC}}}Unit", name=name)
                exponents = {key: value for key, value in unit.items() if key not in ("factor", "offset")}
                ElementTree.SubElement(element, f"{{{SSC}}}BaseUnit", exponents)
        ElementTree.indent(root)
        found: bytes = ElementTree.tostring(root, "UTF-8", xml_declaration=True)
        return found.decode("utf-8") + "\n"


class Model(Linearizer):
    """The FMU's linear model, eq. (11), as a function of its parameters: `at(values)`, with the outputs that can be measured.

    known: the FMU's parameters. Raises UserError if the FMU is missing, is not the testbed, or rejects a value.
    """

    def __init__(self, fmu: str | os.PathLike[str] | None = None):
        """Load and instantiate the FMU file `fmu` (default: see prw.testbed.default_fmu)."""
        super().__init__(fmu, outputs=CHANNELS)
        self.known = Parameters(self.loaded)
