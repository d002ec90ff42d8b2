"""Messages, tolerances, values of all types, inputs with their own times and arrays, converted between Python and FMUs that behave like FMUs
of other producers. The Rust tests of fmu-run test each `manner` in both FMI versions, and what the FMUs get."""

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


@pytest.fixture
def made(tmp_path):
    """Returns a function that opens the FMU with a manner."""
    opened = []

    def make(manner, version="2.0", changes=None):
        opened.append(fmu_run.Fmu(foreign(tmp_path, manner, version, changes)))
        return opened[-1]

    yield make
    for fmu in opened:
        fmu.close()


def test_tolerance(made):
    fmu = made("tolerance")
    for tolerance, passed in (("default", 1e-5), (1e-3, 1e-3), (None, -1.0)):
        assert fmu.run(TIME, outputs=["tolerance"], tolerance=tolerance)["tolerance"][0, 0] == passed
        assert fmu.instances(tolerance=tolerance).get("tolerance")[0] == passed
    for wrong in (0.0, "tight", True):
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
    with pytest.raises(
        ValueError, match="integers that floating-point numbers do not have; set 64-bit integers by themselves"
    ):
        two.set(["wide", "u"], np.array([2**53 + 1, 0]))
    with pytest.raises(ValueError, match="wide"):
        two.set(["wide", "u"], [2.0**60, 0.0])
    two.set("label", "both", mask=[True, False])
    assert two.get("wide_out").tolist() == [2**62 + 1, 7] and two.get("echo").tolist() == ["both", "two"]
    assert two.texts("echo") == ["both", "two"]
    for name, value, why in [
        ("wide", 1e17, "may not be the one that is meant"),
        ("natural", 2**64, "natural is an integer from 0 to 18446744073709551615 and cannot be 18446744073709551616"),
        ("natural", 2**200, f"must be an integer of at most 64 bits, it is {2**200}"[:60]),
        ("label", 3, "label is a string, its value cannot be 3"),
    ]:
        with pytest.raises(ValueError, match=re.escape(why)):
            two.set(name, value)
        with pytest.raises(ValueError, match=re.escape(why)):
            fmu.run(TIME, outputs=["y"], start={name: value})
    with pytest.raises(ValueError, match=re.escape("the shape (3,); it must be one value or (2,)")):
        two.set("label", ["a", "b", "c"])
    # A failed run lacks values, so its arrays contain objects, with None for missing values.
    failed = made("discard", "3.0").run(TIME, start={"wide": wide[0]}, outputs=["wide_out", "echo"])
    assert failed.errors and failed["wide_out"][0].tolist() == [wide[0]] * 6 + [None] * 5
    assert failed["echo"][0].tolist() == ["none"] * 6 + [None] * 5
    runs.to_pandas()


#: Elements of further arrays: name, type and value reference.
ELEMENTS = {
    "2.0": [("q[1]", "Real", 1), ("q[2]", "Real", 3), ("n[1]", "Integer", 16), ("n[2]", "Integer", 8)]
    + [("s[1]", "String", 6), ("s[2]", "String", 7)],
    "3.0": [("q[1]", "Float64", 1), ("q[2]", "Float64", 3), ("n[1]", "Int32", 16), ("n[2]", "Int32", 8)]
    + [("s[1]", "String", 6), ("s[2]", "String", 7), ("w[1]", "Int64", 9), ("w[2]", "Int64", 10)]
    + [("b[1]", "Binary", 11), ("b[2]", "Binary", 12), ("m[1]", "UInt64", 17), ("m[2]", "UInt64", 13)],
}
STARTS = {
    "2.0": {"label": ["a", "b"], "gain": [0.5, 2.5], "valve": 7},
    "3.0": {
        "label": ["a", "b"],
        "gain": [0.5, 2.5],
        "valve": 7,
        "wide": 2**60 + 1,
        "natural": [2**63, 5],
        "bytes": b"x\0",
    },
}


def with_arrays(version):
    """Returns the change of the model description that adds the ELEMENTS."""
    of_fmi2 = (
        '<ScalarVariable name="{}" valueReference="{}" causality="local" variability="discrete"><{}/></ScalarVariable>'
    )
    of_fmi3 = '<{2} name="{0}" valueReference="{1}" causality="local" variability="discrete"/>'
    write = of_fmi2 if version == "2.0" else of_fmi3
    variables = "".join(write.format(name, reference, kind) for name, kind, reference in ELEMENTS[version])
    return {"</ModelVariables>": f"{variables}</ModelVariables>"}


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("prefixes", [("",), ("one.", "two.")], ids=["FMU", "system"])
def test_outputs_have_their_own_values_in_any_list(tmp_path, version, prefixes):
    """Each output of a random list equals the output that is read alone, also if arrays of other types precede it."""
    random = np.random.default_rng(5)
    of_one = ["y", "u", "gain", "counter", "label", *(["vector", "wide", "sum"] if version == "3.0" else [])]
    of_one += [name for name, *_ in ELEMENTS[version]] + sorted({name[0] for name, *_ in ELEMENTS[version]})
    names = [prefix + name for prefix in prefixes for name in of_one]
    start = {
        prefix + name: value[::-1] if number else value
        for number, prefix in enumerate(prefixes)
        for name, value in STARTS[version].items()
        if isinstance(value, list) or not number
    }
    inputs = {f"{prefix}u": TIME + number for number, prefix in enumerate(prefixes)}
    with fmu_run.Fmu(foreign(tmp_path, "plain", version, with_arrays(version))) as fmu:
        model = fmu if prefixes == ("",) else fmu_run.System({prefix[:-1]: fmu for prefix in prefixes}, {})

        def run(outputs):
            return model.run(TIME, inputs=inputs, start=start, outputs=outputs, measures=["end"], every=2).check()

        def end(runs, name):
            try:
                return runs[name, "end"]
            except KeyError:
                return None

        alone = {name: run([name]) for name in names}
        assert alone[f"{prefixes[-1]}s"][f"{prefixes[-1]}s"].shape == (2, 6, 2)
        assert end(alone[f"{prefixes[-1]}q"], f"{prefixes[-1]}q").shape == (2, 2)
        for _ in range(20):
            outputs = random.choice(names, random.integers(2, 9)).tolist()
            runs = run(outputs)
            assert list(runs) == list(dict.fromkeys(outputs))
            for name in outputs:
                assert runs[name].dtype == alone[name][name].dtype and np.array_equal(runs[name], alone[name][name]), (
                    outputs
                )
                assert np.array_equal(end(runs, name), end(alone[name], name)), (name, outputs)
            frame = runs.to_pandas()
            for name in set(outputs) & set(frame):
                assert np.array_equal(frame[name], alone[name][name].ravel()), (name, outputs)


def test_columns_of_one_name(made):
    more = '<Float64 name="y_end" valueReference="1" causality="local"/></ModelVariables>'
    runs = made("plain", "3.0", {"</ModelVariables>": more}).run(
        TIME, outputs=["y", "y_end"], measures=["end"], every=1
    )
    for table in (runs.to_pandas, runs.to_xarray):
        with pytest.raises(ValueError, match="two different columns would be called 'y_end'; read them from the Runs"):
            table()
    mixed = '<Float64 name="x[1]" valueReference="1"/><String name="x[2]" valueReference="6"/></ModelVariables>'
    fmu = made("plain", "3.0", {"</ModelVariables>": mixed})
    with pytest.raises(
        ValueError, match=re.escape("the elements of x have different types; request them by their names, such as x[1]")
    ):
        fmu.run(TIME, outputs=["y", "x"])
    assert list(fmu.run(TIME, outputs=["x[2]", "x[1]"])) == ["x[2]", "x[1]"]


def test_elements_with_different_units(made):
    angles = (
        '<UnitDefinitions><Unit name="rad"><DisplayUnit name="deg" factor="57.29577951308232"/></Unit>'
        '<Unit name="grad"><DisplayUnit name="deg" factor="0.9"/></Unit></UnitDefinitions><DefaultExperiment'
    )
    more = "".join(
        f'<Float64 name="a[{k}]" valueReference="{reference}" causality="input" start="0" unit="{unit}"/>'
        for k, (reference, unit) in enumerate([(1, "rad"), (3, "grad")], 1)
    )
    changes = {"<DefaultExperiment": angles, "</ModelVariables>": f"{more}</ModelVariables>"}
    fmu = made("plain", "3.0", changes)
    with pytest.raises(
        ValueError, match="the elements of a have different units, so its values cannot be in deg; give each element"
    ):
        fmu.run(TIME, inputs={"a": ([9.0, 9.0], "deg")}, outputs=["a"])
    runs = fmu.run(TIME, inputs={"a[1]": (9.0, "deg"), "a[2]": (9.0, "deg")}, outputs=["a"])
    np.testing.assert_allclose(runs["a"][0, -1], [np.pi / 20, 10.0])


def test_numbers_of_any_layout(made):
    """Byte orders, types and strides of arrays do not change their values."""
    fmu, random = made("plain"), np.random.default_rng(8)
    model = fmu.instances(3)

    def laid_out(values):
        """Returns an array with these values in a random layout."""
        kind = random.choice(["f2", "f4", "f8", "i1", "i2", "i4", "i8", "u1", "u2", "u4"])
        dtype = np.dtype(random.choice(["<", ">"]) + kind)
        steps = [slice(None, None, step) for step in random.choice([1, 2, -1, -3], np.ndim(values))]
        room = np.zeros([abs(step.step) * size for step, size in zip(steps, np.shape(values))], dtype)
        if random.integers(2):
            room = np.asfortranarray(room)
        found = room[tuple(steps)]
        found[...] = values
        assert found.shape == np.shape(values)
        return found

    for _ in range(100):
        time, u = np.cumsum(random.integers(1, 9, 5)), random.integers(0, 100, (3, 5))
        gain, own = random.integers(0, 100, 3), random.integers(0, 100, 5)
        given = {
            "time": laid_out(time),
            "u": laid_out(u),
            "gain": laid_out(gain),
            "valve": (laid_out(time), laid_out(own)),
        }
        copies = {name: np.ascontiguousarray(given[name], dtype=np.float64) for name in ("time", "u", "gain")}
        runs = fmu.run(
            given["time"],
            inputs={"u": given["u"], "valve": given["valve"]},
            start={"gain": given["gain"]},
            outputs=["u", "gain", "valve"],
        ).check()
        assert np.array_equal(runs.time, copies["time"]) and np.array_equal(runs["u"], copies["u"])
        assert np.array_equal(runs["gain"][:, 0], copies["gain"]) and np.array_equal(runs["valve"], [own] * 3)
        pairs = random.integers(0, 100, (3, 2))
        model.set(["u", "gain"], laid_out(pairs))
        assert np.array_equal(model.get(["u", "gain"]), pairs)
        model.set("u", laid_out(gain))
        out = np.zeros(3)
        assert model.get("u", out=out) is out and np.array_equal(out, gain)
    for out in (np.zeros(3, ">f8"), np.zeros(3, "f4"), np.zeros(6)[::2], np.zeros(3, "i8")):
        with pytest.raises(
            ValueError, match="out must be a writable, contiguous array of float64, in the byte order of this machine"
        ):
            model.get("u", out=out)


def test_arrays_that_are_too_large_for_memory(made):
    """The arrays of 256 TB take no memory, because all of their values are the same one."""
    fmu, huge = made("plain"), np.broadcast_to(1.0, (2**45,))
    for arguments, name in [
        ({"time": huge}, "time"),
        ({"inputs": {"u": huge}}, "u"),
        ({"inputs": {"u": (huge, huge)}}, "the times of u"),
        ({"start": {"gain": huge}}, "gain"),
    ]:
        with pytest.raises(MemoryError, match=f"^{name} has {2**45} values, for whose copy there is not enough memory"):
            fmu.run(**{"time": TIME, "outputs": ["y"], **arguments})
    with pytest.raises(MemoryError):
        fmu.run(TIME, outputs=["y"], start={"gain": np.broadcast_to(np.float32(1), (2**45,))})


def test_mappings_of_any_kind(made):
    pandas = pytest.importorskip("pandas")
    fmu, u = made("plain"), TIME + 1
    expected = fmu.run(TIME, inputs={"u": u, "valve": 3.0}, start={"gain": 2.0}, outputs=["y", "u", "valve"])
    for inputs in (pandas.DataFrame({"u": u, "valve": np.full(11, 3.0)}), pandas.Series({"u": u, "valve": 3.0})):
        runs = fmu.run(TIME, inputs=inputs, start=pandas.Series({"gain": 2.0}), outputs=["y", "u", "valve"])
        assert all(np.array_equal(runs[name], expected[name]) for name in expected)
    found = fmu.sensitivities(TIME, outputs=["y"], parameters="gain", start=pandas.Series({"gain": 2.0}))
    np.testing.assert_allclose(found["y", "gain"], 1.0)


def test_a_start_value_that_is_no_number_is_kept_as_written(made):
    fmu = made("plain", changes={'"tunable"><Real start="0"/>': '"tunable"><Real start="7 .5"/>'})
    assert fmu.variables["gain"].start == "7 .5"
    with pytest.raises(ValueError, match=r"the start value of gain in the FMU is '7 \.5', not a number"):
        fmu.sensitivities(TIME, outputs=["y"], parameters=["gain"])


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
        (([[0.0], [1.0]], [1.0, 2.0]), "the times of u have the shape (2, 1)"),
        (([0.0, 1.0], [1.0, 2.0], "deg"), "u has no unit"),
        (
            ([0.0, 1.0], [1.0, 2.0], [3.0, 4.0]),
            "u is a tuple of three, (times, values, unit), but its unit is no string",
        ),
    ]:
        with pytest.raises(ValueError, match=re.escape(why)):
            fmu.run(TIME, inputs={"u": value}, outputs=["u"])


def test_structural_parameters(made):
    fmu = made("plain", "3.0")
    runs = fmu.run(TIME, start={"size": 5, "vector": np.arange(5.0)}, outputs=["vector", "sum"])
    assert runs["vector"].shape == (1, 11, 5) and (runs["sum"] == 10).all()
    model = fmu.instances(2, start={"size": 4})
    assert model.get("vector").tolist() == [[1.0, 2.0, 3.0, 4.0]] * 2
    with pytest.raises(ValueError, match="the start value of vector has the shape"):
        fmu.run(TIME, start={"size": 2, "vector": [1.0, 2.0, 3.0]}, outputs=["sum"])
    with pytest.raises(ValueError, match="size is a structural parameter"):
        model.reset(start={"size": 3})
