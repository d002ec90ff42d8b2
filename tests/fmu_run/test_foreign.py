"""Messages, tolerances, values of all types, inputs with their own times and arrays, converted between Python and FMUs that behave like FMUs
of other producers. The Rust tests of fmu-run test each `manner`."""

from __future__ import annotations

import logging
import platform
import re

import fmu_run
import numpy as np
import pytest
from c_models import pack

if platform.machine() != "x86_64" or platform.system() != "Linux":
    pytest.skip("the FMUs are built for Linux on x86_64", allow_module_level=True)

TIME = np.arange(11) / 10
VERSIONS = ["2.0", "3.0"]


def foreign(directory, manner, version="2.0", changes=None):
    """Packs the FMU with this manner and for this FMI version into the directory, and returns it."""
    path, description = directory / f"{manner}{version[0]}.fmu", f"integrator{version[0]}"
    return pack(path, "integrator", description, {"TRAITS": manner, **(changes or {})})


@pytest.fixture(params=VERSIONS)
def made(request, tmp_path):
    """Returns a function that opens the FMU with a manner. Each test runs once for FMI 2.0 and once for FMI 3.0."""
    opened = []

    def make(manner, version=request.param, changes=None):
        opened.append(fmu_run.Fmu(foreign(tmp_path, manner, version, changes)))
        return opened[-1]

    yield make
    for fmu in opened:
        fmu.close()


def test_tolerance(made):
    fmu = made("tolerance")
    for tolerance, error in (("default", 1e-5), (1e-3, 1e-3), (None, 1e-2)):
        runs = fmu.run(TIME, inputs={"u": 1.0}, outputs=["y", "tolerance", "stop"], tolerance=tolerance)
        assert runs["y"][0, -1] == pytest.approx(1 + error, abs=1e-12) and runs["stop"][0, 0] == 1.0
        assert fmu.instances(tolerance=tolerance).get("tolerance")[0] == (-1.0 if tolerance is None else error)
    for wrong in (0.0, -1e-3, np.inf, "tight", True):
        with pytest.raises(ValueError, match="tolerance"):
            fmu.run(TIME, outputs=["y"], tolerance=wrong)


def test_a_function_receives_messages(made):
    fmu, heard = made("chatty"), []
    runs = fmu.run(TIME, outputs=["y"], start={"gain": [1.0, 2.0]}, log=lambda *message: heard.append(message))
    assert runs.ok.all()
    assert sorted(heard) == [(run, "OK", "step", "a step") for run in (0, 1) for _ in range(10)]
    heard.clear()
    model = fmu.instances(3, log=lambda *message: heard.append(message))
    assert heard == []
    model.step(0.1, mask=[True, False, True])
    assert sorted(heard) == [(0, "OK", "step", "a step"), (2, "OK", "step", "a step")]
    greetings = []
    stranger = made("null_environment").instances(2, log=lambda *message: greetings.append(message))
    assert {message[1:] for message in greetings} == {("Warning", "greeting", "my environment is not yours")}
    # The function may use instances, and its exceptions reach the caller.
    times = []
    made("chatty").instances(log=lambda *_: times.append(stranger.time[0])).step(0.5)
    assert times == [0.0]

    def fail(*message):
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        fmu.run(TIME, outputs=["y"], log=fail)
    with pytest.raises(RuntimeError, match="enough"):
        fmu.instances(log=fail).step(0.1)


def test_a_logger_receives_messages(made, caplog):
    caplog.set_level(logging.DEBUG)
    assert made("discard").run(TIME, outputs=["y"], log=logging.getLogger("fmu")).errors
    (record,) = caplog.records
    assert (record.name, record.levelname) == ("fmu", "WARNING")
    assert record.getMessage() == "instance 0, error: the step is too large"
    with pytest.raises(ValueError, match="log must be a function or a logging.Logger"):
        made("plain").run(TIME, outputs=["y"], log="messages.txt")


def test_messages_of_an_fmu_that_makes_no_instance(made):
    heard = []
    with pytest.raises(fmu_run.FmuError, match="the stop time is missing"):
        made("stop_time").instances(log=lambda *message: heard.append(message))
    assert heard == [(0, "Error", "error", "the stop time is missing")]


def test_temperatures_and_their_differences(made):
    kelvin = '<UnitDefinitions><Unit name="K"><DisplayUnit name="degC" offset="-273.15"/></Unit></UnitDefinitions><DefaultExperiment'
    for relative, expected in (("false", 278.15), ("true", 5.0)):
        changes = {
            "<DefaultExperiment": kelvin,
            'canHandleVariableCommunicationStepSize="true"': 'canInterpolateInputs="true"',
            '<Real start="0"/>': f'<Real start="0" unit="K" relativeQuantity="{relative}"/>',
        }
        fmu = made("plain", "2.0", changes)
        time, given = [0.0, 1.0, 2.0], (5.0, "degC")
        for arguments in ({"inputs": {"u": given}}, {"start": {"u": given}}):
            runs = fmu.run(time, outputs=["u"], **arguments).check()
            assert runs["u"][0, 0] == pytest.approx(expected)
        assert fmu.converted("u", 5.0, "degC") == pytest.approx(expected)
        # The derivative of a temperature has no offset in any case: y = 2 s * 1 s / 2 * 5 K/s.
        runs = fmu.run(time, inputs={"u": 0.0}, input_derivatives={"u": given}, outputs=["y"]).check()
        assert runs["y"][0, 2] == pytest.approx(5.0)


def test_masked_values(made):
    fmu, masked = made("plain"), np.ma.array([1.0, 9.0], mask=[False, True])
    model = fmu.instances(2)
    for call, name in (
        (lambda: fmu.run([0.0, 1.0], inputs={"u": masked}, outputs=["y"]), "u"),
        (lambda: fmu.run([0.0, 1.0], start={"gain": masked}, outputs=["y"]), "gain"),
        (lambda: model.set("u", masked), "values"),
    ):
        with pytest.raises(ValueError, match=f"{name} has masked values; replace them with its method filled"):
            call()
    runs = fmu.run([0.0, 1.0], inputs={"u": masked.filled(2.0)}, outputs=["u"])
    assert runs["u"].tolist() == [[1.0, 2.0]]
    fmu.run([0.0, 1.0], inputs={"u": np.ma.array([1.0, 9.0])}, outputs=["u"]).check()


def test_exact_values(made, tmp_path):
    fmu = made("plain", "3.0")
    wide, natural = [2**53 + 1, -(2**63)], 2**64 - 1
    runs = fmu.run(
        TIME[:3],
        inputs={"label": ["a", "", "ä"], "bytes": (([0.0, 0.15]), [b"\0\1", b""])},
        start={"wide": wide, "natural": natural},
        outputs=["echo", "bytes_out", "wide_out", "natural", "y"],
    )
    assert runs["echo"].tolist() == [["a", "", "ä"]] * 2
    assert runs["bytes_out"].tolist() == [[b"\0\1", b"\0\1", b""]] * 2
    assert runs["wide_out"].dtype == np.int64 and runs["wide_out"].tolist() == [[value] * 3 for value in wide]
    assert runs["natural"].dtype == np.uint64 and (runs["natural"] == np.uint64(natural)).all()
    assert list(runs) == ["echo", "bytes_out", "wide_out", "natural", "y"]
    assert runs.start["wide"].tolist() == wide
    one = fmu.run(TIME, inputs={"wide": np.arange(11) + 2**60}, outputs=["wide_out"])
    assert one["wide_out"][0].tolist() == [2**60 + k for k in range(11)]
    two = fmu.instances(2, start={"wide": wide, "bytes": b"x\0", "label": ["one", "two"]})
    assert two.get("wide_out").tolist() == wide and two.get("bytes_out").tolist() == [b"x\0"] * 2
    two.set("wide", [2**62 + 1, 7])
    two.set("label", "both", mask=[True, False])
    assert two.get("wide_out").tolist() == [2**62 + 1, 7] and two.get("echo").tolist() == ["both", "two"]
    assert two.texts("echo") == ["both", "two"]
    for name, value, why in [
        ("wide", 2**63, "wide is an integer from -9223372036854775808 to 9223372036854775807 and cannot be"),
        ("wide", 1.5, "its value cannot be 1.5"),
        ("wide", 1e17, "may not be the one that is meant"),
        ("natural", -1, "cannot be -1"),
        ("label", 3, "label is a string, its value cannot be 3"),
        ("bytes", "text", "bytes is binary"),
        ("label", ["a", "b", "c"], "the shape (3,); it must be one value or (2,)"),
    ]:
        for call in (lambda name=name, value=value: two.set(name, value),):
            with pytest.raises(ValueError, match=re.escape(why)):
                call()
        if not isinstance(value, list):
            with pytest.raises(ValueError, match=re.escape(why)):
                fmu.run(TIME, outputs=["y"], start={name: value})
    # A failed run lacks values, so its arrays contain objects, with None for missing values.
    failed = made("discard", "3.0").run(TIME, start={"wide": wide[0]}, outputs=["wide_out", "echo"])
    assert failed.errors and failed["wide_out"][0].tolist() == [wide[0]] * 6 + [None] * 5
    assert failed["echo"][0].tolist() == ["none"] * 6 + [None] * 5
    runs.to_pandas()


def test_inputs_with_their_own_times(made):
    fmu = made("plain")
    runs = fmu.run(
        TIME,
        inputs={
            "u": ([0.0, 0.5, 0.5, 1.0], [[0.0, 1.0, 3.0, 3.0], [5.0] * 4]),
            "valve": (np.array([0.0, 0.3]), [1, 4]),
        },
        outputs=["u", "valve"],
    )
    np.testing.assert_allclose(runs["u"], [[0, 0.2, 0.4, 0.6, 0.8, 3, 3, 3, 3, 3, 3], [5] * 11])
    np.testing.assert_array_equal(runs["valve"], [[1, 1, 1, 4, 4, 4, 4, 4, 4, 4, 4]] * 2)
    # A tuple of numbers has a value for each time; a list of rows has a row for each run.
    two = fmu.run(TIME[:2], inputs={"u": (1.0, 2.0)}, outputs=["u"])
    assert two["u"].tolist() == [[1.0, 2.0]]
    assert fmu.run(TIME[:2], inputs={"u": [[1.0, 2.0], [3.0, 4.0]]}, outputs=["u"])["u"].tolist() == [[1, 2], [3, 4]]
    for value, why in [
        (([0.0, 1.0], [1.0, 2.0, 3.0]), "u has the shape (3,); it must be (2,), (runs, 2) or one value"),
        (([1.0, 0.0], [1.0, 2.0]), "the times of u decrease: 0 follows 1"),
        (([0.0, np.nan], [1.0, 2.0]), "times must be finite"),
        (([[0.0], [1.0]], [1.0, 2.0]), "the times of u have the shape (2, 1)"),
        (([0.0, 1.0], [1.0, 2.0], "deg"), "u has no unit"),
    ]:
        with pytest.raises(ValueError, match=re.escape(why)):
            fmu.run(TIME, inputs={"u": value}, outputs=["u"])


def test_structural_parameters(made):
    fmu = made("plain", "3.0")
    runs = fmu.run(TIME, start={"size": 5, "vector": np.arange(5.0)}, outputs=["vector", "sum"])
    assert runs["vector"].shape == (1, 11, 5) and (runs["sum"] == 10).all()
    assert fmu.run(TIME, start={"size": 2}, outputs=["sum"])["sum"][0, 0] == 3.0
    model = fmu.instances(2, start={"size": 4})
    assert model.get("vector").tolist() == [[1.0, 2.0, 3.0, 4.0]] * 2
    model.reset()
    assert model.get("sum").tolist() == [10.0, 10.0]
    for start in ({"size": [2, 3]}, {"size": 2, "vector": [1.0, 2.0, 3.0]}):
        with pytest.raises(ValueError):
            fmu.run(TIME, start=start, outputs=["sum"])
    with pytest.raises(ValueError, match="size is a structural parameter"):
        model.reset(start={"size": 3})
