"""Tests of the pages in the FMUs without a browser: the WebAssembly module gives the same bits as the library, and the testbed's
page loads no other file."""

from __future__ import annotations

import base64
import json
import re
import struct
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest
from built import ROOT, built, script_of, text_of
from fmpy import read_model_description
from fmu_run import Fmu
from lagrange import OUTPUTS
from test_references import NAMES
from wasmtime import Engine, FuncType, Linker, Module, Store, ValType

from prw.checking.experiments import read_experiments

PAGE = "documentation/index.html"
GUID = re.compile(rb' guid="(\{[-0-9a-f]+\})"')
PACKED = re.compile(r'\{ description: "([^"]*)", module: "([^"]*)" \},')


def page_of(fmu: Path) -> str:
    with zipfile.ZipFile(fmu) as archive:
        page = archive.read(PAGE).decode()
    if "<script" not in page:
        pytest.skip("the page does not run the FMU: rustup target add wasm32-unknown-unknown, then make fmu")
    return page


@pytest.fixture(scope="module")
def page(testbed) -> str:
    return page_of(testbed)


@pytest.fixture(scope="module")
def packed(page) -> list[bytes]:
    """The files that the page contains: description and module of the testbed, then description and module of the controller."""
    pairs = PACKED.findall(script_of(page))
    return [zlib.decompress(base64.b64decode(part), wbits=-15) for pair in pairs for part in pair]


class WebAssembly:
    """Calls the module's functions of FMI 2.0 as the page does."""

    def __init__(self, module: bytes, guid: str):
        engine = Engine()
        self.store, self.messages = Store(engine), []
        linker, number = Linker(engine), ValType.i32()
        linker.define_func("fmu", "fmu_log", FuncType([number] * 3, []), lambda *message: self.messages.append(message))
        self.functions = linker.instantiate(self.store, Module(engine, module)).exports(self.store)
        self.buffer = self.call("fmu_argument_buffer", 4096)
        self.write(0, b"page\0", guid.encode() + b"\0")
        self.component = self.call("fmi2Instantiate", self.buffer, 1, self.buffer + 5, 0, self.buffer + 1024, 0, 0)
        assert self.component

    def call(self, name: str, *values: float) -> int:
        return self.functions[name](self.store, *values)

    def write(self, offset: int, *parts: bytes) -> None:
        self.functions["memory"].write(self.store, b"".join(parts), self.buffer + offset)

    def succeed(self, name: str, *values: float) -> None:
        assert self.call(name, self.component, *values) == 0, name

    def set(self, kind: str, letter: str, values: dict[int, float]) -> None:
        self.write(
            0, struct.pack(f"<{len(values)}I", *values), struct.pack(f"<{len(values)}{letter}", *values.values())
        )
        self.succeed(f"fmi2Set{kind}", self.buffer, len(values), self.buffer + 4 * len(values))

    def get(self, references: list[int]) -> bytes:
        self.write(0, struct.pack(f"<{len(references)}I", *references))
        self.succeed("fmi2GetReal", self.buffer, len(references), self.buffer + 1024)
        start = self.buffer + 1024
        return bytes(self.functions["memory"].read(self.store, start, start + 8 * len(references)))


def test_the_page_contains_the_fmus(testbed, page, packed):
    """The page has the same text in both FMI versions. In the FMU for FMI 3.0, it contains the modules for FMI 2.0, too."""
    directory = testbed.parents[testbed.parent.name == "fmi3"]
    assert text_of(testbed) == text_of(directory / testbed.name)
    for offset, name in enumerate([testbed.name, "prw_controller.fmu"]):
        description, module = packed[2 * offset : 2 * offset + 2]
        with zipfile.ZipFile(directory / name) as archive:
            assert GUID.sub(b"", archive.read("modelDescription.xml")) == GUID.sub(b"", description)
        assert GUID.findall(description)[0] in module
    # The page shows the guid of its FMU.
    assert GUID.findall(packed[0])[0].decode() == read_model_description(str(testbed)).guid


def test_the_controllers_page_runs_it(controller):
    page = page_of(controller)
    script = script_of(page)
    assert len(PACKED.findall(script)) == 2 and "\n], ...[{},[]]).catch(" in script
    # The testbed that runs next to the controller has the description of the testbed's FMU, except for the guid.
    description, module = (zlib.decompress(base64.b64decode(part), wbits=-15) for part in PACKED.findall(script)[1])
    with zipfile.ZipFile(built("prw_testbed.fmu")) as archive:
        original = archive.read("modelDescription.xml")
    assert GUID.sub(b"", description) == GUID.sub(b"", original)
    assert GUID.findall(description)[0] in module


def test_it_is_small_and_loads_nothing(page):
    live = page[page.index("<style>\n.live,") :] + PACKED.sub("", script_of(page))
    assert len(page.encode()) < 270e3 and len(zlib.compress(page.encode(), 9)) < 190e3
    assert not re.search(r"https?:|fetch\(|XMLHttp|import\(|@import|url\(|WebSocket| src=", live)


def test_the_shaper_has_the_pole_of_pitch():
    script = (ROOT / "docs" / "fmu-page" / "wrist" / "testbed.js").read_text(encoding="utf-8")
    (pole,) = re.findall(r"const PITCH_POLE = \{ real: (\S+), imaginary: (\S+) \}", script)
    numbers = json.loads((ROOT / "docs" / "fmu-page" / "figures" / "numbers.json").read_text(encoding="utf-8"))
    assert [float(part) for part in pole] == pytest.approx(numbers["poles"]["pitch"][1], abs=5e-4)


@pytest.mark.parametrize("name", NAMES)
def test_the_module_is_bit_identical_to_the_library(fmu, packed, name):
    experiment = next(one for one in read_experiments(fmu) if one.name == name)
    description = read_model_description(str(fmu))
    variables = {one.name: one for one in description.modelVariables}
    module = WebAssembly(packed[1], GUID.findall(packed[0])[0].decode())
    module.succeed("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
    for kind, letter in (("Real", "d"), ("Integer", "i"), ("Boolean", "i")):
        of_kind = {k: v for k, v in experiment.parameters.items() if variables[k].type == kind}
        module.set(kind, letter, {variables[k].valueReference: v for k, v in of_kind.items()})
    module.succeed("fmi2EnterInitializationMode")
    module.succeed("fmi2ExitInitializationMode")
    inputs = ("theta1", "theta2", "omega1", "omega2")
    times = 1e-3 * np.arange(round(experiment.stop_time / 1e-3) + 1)
    signals = np.column_stack([np.interp(times, experiment.inputs["time"], experiment.inputs[name]) for name in inputs])
    with Fmu(fmu) as loaded:
        library = loaded.instances(start=dict(experiment.parameters))
        for k, row in enumerate(signals):
            module.set("Real", "d", {variables[name].valueReference: value for name, value in zip(inputs, row)})
            library.set(inputs, row)
            there = module.get([variables[name].valueReference for name in OUTPUTS])
            assert there == library.get(OUTPUTS)[0].astype("<f8").tobytes(), f"at {times[k]} s"
            if k + 1 < len(times):
                module.succeed("fmi2DoStep", times[k], times[k + 1] - times[k], 1)
                library.step(to=times[k + 1])
