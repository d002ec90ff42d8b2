"""Structure and units in the model description of an FMU. `fmu_run` reads its variables."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

#: Types of continuous variables in FMI 2.0 and 3.0.
CONTINUOUS = ("Real", "Float64", "Float32")
INTERFACES = ("CoSimulation", "ModelExchange")


class Unit(NamedTuple):
    """exponents: by base unit, as strings. displayed: by display unit, the factor from the display unit to this unit."""

    exponents: Mapping[str, str]
    displayed: Mapping[str, float]


class Description(NamedTuple):
    """Parts of a model description. derivatives: the name of each state's derivative, by state. outputs: the continuous
    ones. directional: by interface type, whether it provides directional derivatives; attribute: the XML attribute that
    declares them. display_units: by variable. units: by name."""

    derivatives: dict[str, str]
    outputs: tuple[str, ...]
    directional: dict[str, bool]
    attribute: str
    display_units: dict[str, str]
    units: dict[str, Unit]


def read_description(fmu: Path) -> Description:
    """Read the model description of an FMU of FMI 2.0 or 3.0. The caller has loaded it with `fmu_run`, which checks it."""
    with zipfile.ZipFile(fmu) as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    # An index in the list, from 1 (section 2.2.8 of FMI 2.0), or a value reference (section 2.4.8 of FMI 3.0).
    fmi2 = str(root.get("fmiVersion")).startswith("2.")
    reference, outputs, derivatives = (
        ("index", "Outputs/Unknown", "Derivatives/Unknown")
        if fmi2
        else ("valueReference", "Output", "ContinuousStateDerivative")
    )
    variables, typed = {}, {}
    for place, element in enumerate(root.iterfind("ModelVariables/*"), start=1):
        attributes = element[0] if fmi2 else element
        variables[str(place) if fmi2 else element.get("valueReference")] = element
        typed[element.get("name", "")] = attributes.tag, attributes
    types = {kind.get("name"): kind[0] if fmi2 else kind for kind in root.iterfind("TypeDefinitions/*")}

    def display_unit(variable: ElementTree.Element) -> str:
        declared = types.get(variable.get("declaredType"), variable)
        return variable.get("displayUnit") or declared.get("displayUnit") or ""

    def names(path: str) -> list[str]:
        return [
            variables[unknown.get(reference)].get("name", "") for unknown in root.iterfind(f"ModelStructure/{path}")
        ]

    attribute = "providesDirectionalDerivative" + ("" if fmi2 else "s")
    offers = {name: found for name in INTERFACES if (found := root.find(name)) is not None}
    return Description(
        {str(variables[typed[name][1].get("derivative")].get("name")): name for name in names(derivatives)},
        tuple(name for name in names(outputs) if typed[name][0] in CONTINUOUS),
        {name: found.get(attribute) in ("true", "1") for name, found in offers.items()},
        attribute,
        {name: display_unit(element) for name, (_, element) in typed.items()},
        {str(unit.get("name")): _unit(unit) for unit in root.iterfind("UnitDefinitions/Unit")},
    )


def _unit(element: ElementTree.Element) -> Unit:
    base = element.find("BaseUnit")
    exponents = {} if base is None else {n: v for n, v in base.items() if n not in ("factor", "offset")}
    # factor: from this unit to the displayed one (section 2.2.2 of FMI 2.0, 2.4.3 of FMI 3.0).
    displayed = {str(d.get("name")): 1 / float(d.get("factor", "1")) for d in element.iterfind("DisplayUnit")}
    return Unit(exponents, displayed)
