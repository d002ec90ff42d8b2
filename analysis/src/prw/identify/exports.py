"""Results for other programs: identified.json for build_fmu, an SSP parameter set, and the report's numbers."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Mapping

from lxml import etree

from prw.files import replacing
from prw.identify.model import Model

SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"
BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


def write_parameters(path: Path, model: Model, values: Mapping[str, float]) -> None:
    """Write all parameters in the format of modelDescription/parameters.json, for `build_fmu --parameters`.

    values: SI, by name; what is not among them keeps the FMU's start value. Units are those the FMU shows values in."""
    entries = {}
    for name, parameter in model.parameters.items():
        value = values.get(name, parameter.start) / parameter.factor
        entries[name] = {"value": value, "unit": parameter.shown, "meaning": parameter.meaning}
    for name, count in model.counts.items():
        entries[name] = {"value": count, "unit": "1", "meaning": model.meaning(name)}
    lines = [f"  {json.dumps(name)}: {json.dumps(entry, ensure_ascii=False)}" for name, entry in entries.items()]
    write_text(path, "{\n" + ",\n".join(lines) + "\n}\n")


def write_ssv(path: Path, model: Model, values: Mapping[str, float], name: str) -> None:
    """Write all Real parameters as an SSP 1.0 parameter set in SI, with the units' definitions."""
    root = etree.Element(f"{{{SSV}}}ParameterSet", nsmap={"ssv": SSV, "ssc": SSC}, version="1.0", name=name)
    parameters = etree.SubElement(root, f"{{{SSV}}}Parameters")
    used = []
    for parameter in model.parameters.values():
        value = values.get(parameter.name, parameter.start)
        element = etree.SubElement(parameters, f"{{{SSV}}}Parameter", name=parameter.name)
        etree.SubElement(element, f"{{{SSV}}}Real", value=repr(float(value)), unit=parameter.unit)
        used.append(parameter.unit)
    for count, number in model.counts.items():
        element = etree.SubElement(parameters, f"{{{SSV}}}Parameter", name=count)
        etree.SubElement(element, f"{{{SSV}}}Integer", value=str(number))
    units = etree.SubElement(root, f"{{{SSV}}}Units")
    for unit in model.units:
        if unit.name in used:
            element = etree.SubElement(units, f"{{{SSC}}}Unit", name=unit.name)
            exponents = {
                base: str(getattr(unit.baseUnit, base)) for base in BASE_UNITS if getattr(unit.baseUnit, base)
            }
            etree.SubElement(element, f"{{{SSC}}}BaseUnit", **exponents)
    text = etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)
    write_text(path, text.decode("utf-8"))


def write_json(path: Path, content: Mapping) -> None:
    """Write `content` as indented JSON."""
    write_text(path, json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def write_text(path: Path, text: str) -> None:
    """Write `text` as UTF-8 with line feeds, all or nothing."""
    with replacing(path) as temporary:
        temporary.write_bytes(text.encode("utf-8"))
