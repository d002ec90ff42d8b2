"""Partial derivatives in Initialization Mode, where states follow from motors or start parameters, against differences."""

from __future__ import annotations

import fmpy
import numpy as np
import pytest

#: Away from zero and from each other.
VALUES = {
    "theta1": 0.3, "theta2": -0.2, "omega1": 1.5, "omega2": -0.7, "theta3_start": 0.25, "theta4_start": -0.4,
    "theta5_start": 0.1, "theta6_start": 0.6, "omega5_start": 2.0, "omega6_start": -3.0,
}  # fmt: skip
#: The width of the central differences, of functions that are no steeper than quadratic but for parameters.
WIDTH = 1e-4


@pytest.fixture(scope="module")
def unzipped(testbed, unpack):
    """The description and the folder of an FMU."""
    return fmpy.read_model_description(str(testbed)), unpack(testbed)


class Initializing:
    """An instance in Initialization Mode."""

    def __init__(self, description, folder, fmi_type: str, flags: dict[str, bool]):
        self.two = description.fmiVersion == "2.0"
        self.fmi = fmpy.instantiate_fmu(folder, description, fmi_type)
        if self.two:
            self.fmi.setupExperiment(startTime=0.0)
        references = {v.name: v.valueReference for v in description.modelVariables}
        for name, value in flags.items():
            self.fmi.setBoolean([references[name]], [value])
        self.fmi.enterInitializationMode()
        for name, value in VALUES.items():
            self.set(references[name], value)

    def set(self, reference: int, value: float) -> None:
        (self.fmi.setReal if self.two else self.fmi.setFloat64)([reference], [value])

    def get(self, references: list[int]) -> np.ndarray:
        return np.array((self.fmi.getReal if self.two else self.fmi.getFloat64)(references))

    def directional(self, unknowns: list[int], known: int) -> np.ndarray:
        arguments = (unknowns, [known], [1.0]) if self.two else (unknowns, [known], [1.0], len(unknowns))
        return np.array(self.fmi.getDirectionalDerivative(*arguments))

    def difference(self, unknowns: list[int], known: int) -> np.ndarray:
        (value,) = self.get([known])
        width = WIDTH * max(abs(value), 1e-2)
        ends = []
        for end in (value + width, value - width):
            self.set(known, end)
            ends.append(self.get(unknowns))
        self.set(known, value)
        return (ends[0] - ends[1]) / (2 * width)


@pytest.mark.parametrize("fmi_type", ["CoSimulation", "ModelExchange"])
@pytest.mark.parametrize("at_rest", [True, False], ids=["at-rest", "given"])
@pytest.mark.parametrize("use_omega", [True, False], ids=["omega", "samples"])
def test_every_initial_unknown_by_every_known(unzipped, fmi_type, at_rest, use_omega):
    """Unknowns and knowns as sections 2.1.9 of FMI 2.0 and 2.2.11 of FMI 3.0 have them."""
    description, folder = unzipped
    instance = Initializing(description, folder, fmi_type, {"start_at_rest": at_rest, "use_omega": use_omega})
    floats = [v for v in description.modelVariables if v.type in ("Real", "Float64") and v.causality != "independent"]
    knowns = [v for v in floats if v.causality == "input" or v.initial == "exact"]
    listed = {unknown.variable.name: unknown for unknown in description.initialUnknowns}
    assert {"tau1", "pitch", "theta3", "theta5", "omega6", "der(omega5)"} <= listed.keys()
    unknowns = [unknown.variable.valueReference for unknown in listed.values()]
    found, expected = {}, {}
    try:
        for known in knowns:
            found[known.name] = instance.directional(unknowns, known.valueReference)
            expected[known.name] = instance.difference(unknowns, known.valueReference)
            if not instance.two:
                adjoint = [
                    instance.fmi.getAdjointDerivative([unknown], [known.valueReference], [1.0], 1)[0]
                    for unknown in unknowns
                ]
                assert np.array_equal(adjoint, found[known.name]), known.name
    finally:
        instance.fmi.freeInstance()
    scale = np.max([np.abs(column) for column in expected.values()], axis=0)
    for name, column in found.items():
        np.testing.assert_allclose(
            column, expected[name], rtol=1e-6, atol=1e-8 * np.max(scale), err_msg=f"{list(listed)} by {name}"
        )
        for unknown, value in zip(listed.values(), column, strict=True):
            if name not in [known.name for known in unknown.dependencies]:
                assert value == 0, f"{unknown.variable.name} by {name}"
    if at_rest:
        by_theta1 = dict(zip(listed, found["theta1"], strict=True))
        assert (by_theta1["pitch"], by_theta1["theta3"], by_theta1["theta5"], by_theta1["tau1"]) == (0.5, 1, 1, 0)
