"""`prw.check` and `prw check` on files as other tools write them; the numbers in them come from the oracle, not from the FMU."""

from __future__ import annotations

import json
import struct
import tracemalloc
import zlib

import numpy as np
import pytest
from lagrange import OUTPUTS, linear_model, table_1
from reference import follow
from scipy.io import savemat

import prw

STEP = 1e-3
UNITS = {
    **dict.fromkeys(("tau1", "tau2"), "N.m"),
    **dict.fromkeys(("pitch_rate", "roll_rate", "omega1", "omega2"), "rad/s"),
}
DEGREES = ("pitch", "roll", "theta3", "theta4")


def fig4(**change: float) -> dict[str, np.ndarray]:
    """Returns time, motors and outputs of Fig. 4 with opposite motor rates, every millisecond for a second. change: parameters."""
    t = np.arange(1001) * STEP
    theta = np.outer(2 * np.sin(5 * np.pi * t) ** 2 / (10 * np.pi), [1, -1])
    omega = np.outer(np.sin(10 * np.pi * t), [1, -1])
    at, _ = follow(linear_model({**table_1(), **change}), t, theta, omega)
    motors = {"theta1": theta[:, 0], "theta2": theta[:, 1], "omega1": omega[:, 0], "omega2": omega[:, 1]}
    return {"time": t, **motors, **at}


@pytest.fixture(scope="module")
def right():
    return fig4()


@pytest.fixture(scope="module")
def soft():
    """The response of a testbed whose k1 is 1 % too low."""
    return fig4(k1=0.99 * table_1()["k1"])


def write_csv(path, columns, titles=None, delimiter=","):
    names = [(titles or {}).get(name, name) for name in columns]
    rows = np.column_stack(list(columns.values()))
    np.savetxt(path, rows, delimiter=delimiter, header=delimiter.join(names), comments="", fmt="%.17g")
    return path


def character_matrix(strings, across):
    """Returns strings as a matrix of characters, one string in each row or, if `across`, in each column."""
    width = max(map(len, strings), default=1)
    rows = [string.ljust(width) for string in strings]
    return np.array(["".join(column) for column in zip(*rows)] if across else rows)


def write_modelica(path, columns, units=False, across=True):
    """Writes a file in OpenModelica's format: MATLAB 4; constants in data_1, trajectories in data_2. A negative index,
    here of tau2, changes the sign."""
    time = columns["time"]
    names, infos, descriptions = (
        ["time", "testbed.k1"],
        [(0, 1, 0, -1), (1, 2, 0, 0)],
        ["Simulation time [s]", "Stiffness"],
    )
    table = [time]
    for name, values in columns.items():
        if name != "time":
            table.append(-values if name == "tau2" else values)
            names.append(f"testbed.{name}")
            infos.append((2, -len(table) if name == "tau2" else len(table), 0, -1))
            descriptions.append(f"of the testbed [{UNITS.get(name, 'rad')}]" if units else "of the testbed")
    constants, table = np.array([[0.0, 1.0], [120.0, 120.0]]), np.array(table)
    content = {
        "Aclass": character_matrix(["Atrajectory", "1.1", "", "binTrans" if across else "binNormal"], False),
        "name": character_matrix(names, across),
        "description": character_matrix(descriptions, across),
        "dataInfo": np.array(infos, dtype=np.int32).T if across else np.array(infos, dtype=np.int32),
        "data_1": constants if across else constants.T,
        "data_2": table if across else table.T,
    }
    savemat(path, content, format="4")
    return path


def test_a_result_that_agrees(right, fmu, tmp_path):
    found = prw.check(write_csv(tmp_path / "run.csv", right), fmu=fmu)
    assert found.agrees and found.experiment.name == "fig4_opposite" and not found.notes
    assert list(found.variables) == list(OUTPUTS)
    assert all(difference.largest < 0.3 * difference.allowed for difference in found.variables.values())
    assert "roll " in found.summary() and "TOO FAR" not in repr(found) and "agrees" in found._repr_html_()


@pytest.mark.parametrize("model_exchange", [False, True])
def test_a_result_that_does_not_agree(soft, fmu, tmp_path, model_exchange):
    found = prw.check(write_csv(tmp_path / "run.csv", soft), fmu=fmu, model_exchange=model_exchange)
    roll = found.variables["roll"]
    assert not found.agrees and not roll.agrees and found.variables["pitch"].agrees
    row = round(roll.at / STEP)
    assert roll.found == soft["roll"][row] and roll.largest == abs(roll.found - roll.expected) > roll.allowed
    assert found.variables["tau1"].agrees != model_exchange
    assert json.loads(found.to_json(tmp_path / "check.json")) == json.loads((tmp_path / "check.json").read_text())
    assert json.loads(found.to_json())["variables"]["roll"]["agrees"] is False
    figure = found.plot()
    assert any("roll: off by" in axis.get_title(loc="left") for axis in figure.axes)


@pytest.mark.parametrize("across", [True, False])
@pytest.mark.parametrize("units", [True, False])
def test_openmodelica(right, soft, fmu, tmp_path, across, units):
    assert prw.check(write_modelica(tmp_path / "wrist_res.mat", right, units, across), fmu=fmu).agrees
    assert not prw.check(write_modelica(tmp_path / "soft_res.mat", soft, units, across), fmu=fmu).agrees


def simulink_vectors(columns):
    return {name if name != "time" else "tout": values[:, None] for name, values in columns.items()}


def simulink_structure(columns):
    """Returns a structure with time, as the blocks Scope and To Workspace log it."""
    signals = np.empty(len(columns) - 1, dtype=object)
    for i, (name, values) in enumerate((n, v) for n, v in columns.items() if n != "time"):
        signals[i] = {"values": values[:, None], "dimensions": 1.0, "label": name, "blockName": f"fig4/{name}"}
    return {"out": {"time": columns["time"][:, None], "signals": signals}}


def simulink_outports(columns):
    """Returns the structure in which Simulink logs the outports of a model if their signals have no names."""
    logged = simulink_structure(columns)["out"]
    return {"yout": {**logged, "signals": np.array([{**signal, "label": ""} for signal in logged["signals"]])}}


def simulink_fields(columns):
    return {"run": {name: values[:, None] for name, values in columns.items()}}


@pytest.mark.parametrize("layout", [simulink_vectors, simulink_structure, simulink_outports, simulink_fields])
def test_simulink(right, soft, fmu, tmp_path, layout):
    for name, columns in (("right", right), ("soft", soft)):
        savemat(tmp_path / f"{name}.mat", layout(columns))
        found = prw.check(tmp_path / f"{name}.mat", "fig4_opposite", fmu=fmu)
        assert found.agrees == (name == "right") and len(found.variables) == len(OUTPUTS)


def test_names_units_and_separators_of_other_tools(right, fmu, tmp_path):
    """Reads semicolons and decimal commas, degrees in the header, and names of components before the variables."""
    degrees = {n: np.rad2deg(v) if n in DEGREES else v for n, v in right.items()}
    titles = {n: f"wrist/testbed/{n} [deg]" if n in DEGREES else f"wrist.root.testbed.{n}" for n in right}
    path = write_csv(tmp_path / "run.csv", degrees, {**titles, "time": '"time"'}, ";")
    path.write_text(path.read_text().replace(".0", ",0").replace(".", ",").replace("wrist,root,testbed,", "a.testbed."))
    assert prw.check(path, fmu=fmu).agrees
    plain = write_csv(tmp_path / "plain.csv", degrees)
    header, *rows = plain.read_text().splitlines()
    with_words = tmp_path / "words.csv"
    with_words.write_text("\n".join([f"# a tool's\nmode,{header}", "# begins", *(f"true,{row}," for row in rows)]))
    assert prw.check(with_words, units=dict.fromkeys(DEGREES, "deg"), fmu=fmu).agrees
    assert prw.check(plain, units=dict.fromkeys(DEGREES, "deg"), fmu=fmu).agrees
    assert "roll looks like degrees; give its unit: roll=deg" in prw.check(plain, fmu=fmu).notes


def test_of_two_rows_at_one_time_the_last_counts(right, fmu, tmp_path):
    """At each time, OMSimulator writes one row before it sets the inputs, and one row after."""
    rows = {n: np.repeat(v, 2) for n, v in right.items()}
    rows["tau1"][::2] += 1.0
    assert prw.check(write_csv(tmp_path / "rows.csv", rows), fmu=fmu).agrees
    rows["tau1"] = rows["tau1"][::-1]
    assert not prw.check(write_csv(tmp_path / "rows.csv", rows), fmu=fmu).agrees


def test_uneven_rows_are_interpolated(fmu, tmp_path):
    """A solver with variable steps writes rows between the reference's times, up to 9 ms apart."""
    full, rng = fig4(), np.random.default_rng(1)
    rows = np.unique(np.append(np.cumsum(rng.integers(1, 6, 400)), [0, 1000]))
    rows = rows[(rows <= 1000) & ((rows % 10 != 0) | (rows % 1000 == 0))]
    path = write_csv(tmp_path / "uneven.csv", {n: v[rows] for n, v in full.items()})
    assert prw.check(path, fmu=fmu).agrees


def test_two_components_with_one_name(right, soft, fmu, tmp_path):
    both = {"time": right["time"], "testbed.roll": right["roll"], "other.roll": soft["roll"]}
    path = write_csv(tmp_path / "both.csv", both)
    assert prw.check(path, fmu=fmu).agrees
    assert not prw.check(path, component="other", fmu=fmu).agrees
    mixed = {**both, "pitch": right["pitch"], "roll [deg]": np.rad2deg(right["roll"])}
    found = prw.check(write_csv(tmp_path / "mixed.csv", mixed), fmu=fmu)
    assert found.agrees
    assert (
        "the outputs are of several components: pitch of none, roll of testbed; `component` chooses one" in found.notes
    )
    path = write_csv(tmp_path / "either.csv", {"time": right["time"], "a.roll": right["roll"], "b.roll": soft["roll"]})
    with pytest.raises(
        prw.UserError, match="component: there are several roll in .*, of the components a, b; name one"
    ):
        prw.check(path, fmu=fmu)


@pytest.mark.parametrize(
    "change, note",
    [
        (lambda c: {**c, "roll": -c["roll"], "pitch": c["pitch"]}, "roll has the other sign"),
        (lambda c: {n: v[:501] for n, v in c.items()}, "the result has only 0 to 0.5 s of the experiment's 0 to 1 s"),
        (lambda c: {n: v for n, v in c.items() if n != "tau2"}, "not in the result: tau2"),
        (
            lambda c: {
                n: v if n in ("time", "theta1", "omega1") else np.append(0 * v[:1], v[:-1]) for n, v in c.items()
            },
            "everything agrees if the result is taken 0.001 s later",
        ),
        (
            lambda c: {**c, "theta2": c["theta1"], "omega2": c["omega1"], "roll": 0 * c["roll"]},
            "theta2 differs from fig4_opposite",
        ),
    ],
)
def test_possible_causes(right, fmu, tmp_path, change, note):
    found = prw.check(write_csv(tmp_path / "run.csv", change(right)), "fig4_opposite", fmu=fmu)
    assert any(note in line for line in found.notes), found.notes


@pytest.mark.parametrize(
    "change, reason",
    [
        (
            lambda c: {n: np.append(v[:1], v[1:10] + 99 * (n == "roll")) for n, v in c.items()},
            "it has only 0 to 0 s of 0 to 1 s",
        ),
        (lambda c: {n: v[:901] for n, v in c.items()}, "it has only 0 to 0.9 s of 0 to 1 s"),
        (lambda c: {n: c[n] for n in ("time", "pitch")}, "no output that it has moves in this experiment; tau1, tau2,"),
        (lambda c: {"rolll" if n == "roll" else n: v for n, v in c.items()}, "its column rolll is not known; name it"),
        (lambda c: {n: v[1:-1] for n, v in c.items()}, ""),
        (lambda c: {n: v[::2] for n, v in c.items() if n.startswith(("time", "th", "pitch", "roll"))}, ""),
        (
            lambda c: {n if n == "time" else f"a.{n}": v for n, v in {**c, "tau": c["tau1"]}.items() if n != "tau1"},
            "tau",
        ),
        (lambda c: {"tau" if n == "tau1" else n if n == "time" else f"a.{n}": v for n, v in c.items()}, ""),
    ],
)
def test_results_that_show_too_little(prw, right, tmp_path, change, reason):
    """An incomplete result does not agree; one that lacks some outputs or the last time does, and the others are named."""
    columns = change(right)
    result = prw("check", write_csv(tmp_path / "run.csv", columns), "--experiment", "fig4_opposite")
    assert "TOO FAR" not in result.stdout
    if reason:
        assert result.returncode == 1 and "agrees" not in result.stdout and reason in result.stderr
        assert "run.csv: does not show whether it agrees: " in result.stderr and result.stderr.count("\n") == 1
    else:
        missing = [name for name in OUTPUTS if not {name, f"a.{name}"} & {*columns}]
        assert result.returncode == 0, result.stderr
        assert not missing or f"; not compared: {', '.join(missing)}\n" in result.stdout


@pytest.mark.parametrize(
    "text, message",
    [
        ("", "the file is empty"),
        ("time,a\n0,1\n1,2\n", "there is none of time, theta1"),
        ("a,b\n0,1\n1,2\n", "there is no column time; it has a, b"),
        ("roll,pitch\n0,1\n1,2\n", "there is no column time; it has roll, pitch"),
        ("time,roll\n0,1\n1\n", "row 3: 1 cell, but the header has 2"),
        ("time,roll\n0,1\n1,x\n", "row 3, column roll: 'x' is not a number"),
        ("time,roll\n0,1\n1,nan\n", "row 3, column roll: nan is not finite"),
        ("time,roll\n1,1\n0,2\n", "time runs backwards after 1 s"),
        ("time,roll\n5,1\n6,2\n", "runs from 5 to 6 s"),
        ("time,roll [N.m]\n0,1\n1,2\n", "column roll: roll cannot be in 'N.m'"),
        ("time,theta1\n0,0\n1,0\n", "has none of the outputs tau1"),
        ("time,roll,roll\n0,1,1\n1,2,3\n", "two columns are called roll"),
        ("time,roll [rad],roll [deg]\n0,1,1\n1,2,2\n", "roll [rad], roll [deg] have different values of roll; rename"),
        ("time,pitch [deg]\n0,1\n1,2\n", "column pitch: the header has the unit deg, but `units` has rad"),
        ("time,roll\n0,1\n1,2\n", "no column pitch, whose unit is given; there are time, roll"),
    ],
)
def test_tables_that_cannot_be_read(fmu, tmp_path, text, message):
    path = tmp_path / "run.csv"
    path.write_text(text)
    with pytest.raises(prw.UserError) as caught:
        prw.check(path, units={"pitch": "rad"} if "unit" in message else {}, fmu=fmu)
    assert str(path) in str(caught.value) and message in str(caught.value)


def matrix(kind: int, sizes: tuple[int, int], content: bytes, name: bytes = b"time") -> bytes:
    """Returns an array in MATLAB's format 5."""

    def element(of: int, data: bytes) -> bytes:
        return struct.pack("<II", of, len(data)) + data + bytes(-len(data) % 8)

    header = element(6, struct.pack("<II", kind, 0)) + element(5, struct.pack("<ii", *sizes)) + element(1, name)
    return element(14, header + content)


#: An array of a few bytes that declares 2^30 cells, and the same in a cell and in a field of a structure.
LARGE = matrix(1, (1 << 15, 1 << 15), b"", b"")
IN_STRUCTURE = struct.pack("<HHI", 5, 4, 8) + struct.pack("<II", 1, 8) + b"inside\0\0" + LARGE


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize(
    ("kind", "sizes", "content"),
    [
        pytest.param(6, (1 << 15, 1 << 15), struct.pack("<II", 9, 8) + bytes(8), id="declared numbers"),
        pytest.param(1, (1 << 15, 1 << 15), b"", id="declared cells"),
        pytest.param(1, (1, 1), LARGE, id="declared cells in a cell"),
        pytest.param(1, (1, 1), matrix(1, (1, 1), LARGE, b""), id="declared cells in a cell of a cell"),
        pytest.param(2, (1, 1), IN_STRUCTURE, id="declared cells in a structure"),
        pytest.param(1, (1, 1 << 15), matrix(1, (0, 0), b"", b"") * (1 << 13), id="cells"),
        pytest.param(6, (1, 1 << 18), struct.pack("<II", 2, 1 << 18) + bytes(1 << 18), id="small numbers"),
        pytest.param(6, (1, 1 << 18), struct.pack("<II", 9, 1 << 21) + bytes(1 << 21), id="numbers"),
    ],
)
def test_mat_files_may_not_be_large(fmu, tmp_path, monkeypatch, kind, sizes, content, compressed):
    """The memory is limited by the size that a file declares, before it is read."""
    monkeypatch.setattr("prw.checking.result.LARGEST", 1 << 20)
    path, data = tmp_path / "run.mat", matrix(kind, sizes, content)
    if compressed:
        data = zlib.compress(data, 1)
        data = struct.pack("<II", 15, len(data)) + data
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + data)
    tracemalloc.start()
    try:
        with pytest.raises(
            prw.UserError, match=r"run.mat: (has more than 1 MB of values|cannot be read as a \.mat file)"
        ):
            prw.check(path, fmu=fmu)
        assert tracemalloc.get_traced_memory()[1] < 10 << 20
    finally:
        tracemalloc.stop()


def test_mat_files_that_cannot_be_read(fmu, tmp_path):
    path = tmp_path / "run.mat"
    path.write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM" + b"\x89HDF\r\n\x1a\n" * 9)
    with pytest.raises(prw.UserError, match=r"format 7.3; save it with: save\('run.mat', ..., '-v7'\)"):
        prw.check(path, fmu=fmu)
    path.write_bytes(b"something else")
    with pytest.raises(prw.UserError, match="cannot be read as a .mat file"):
        prw.check(path, fmu=fmu)
    ramp, short = np.arange(9.0), np.arange(5.0)
    for variables, message in [
        ({"time": ramp, "roll": ramp, "pitch": short}, r"different numbers of values \(time 9, roll 9, pitch 5\)"),
        ({"a": {"time": ramp, "roll": ramp}, "b": {"time": short, "tau1": short}}, r"a.roll 9, b.time 5, b.tau1 5\)"),
        (
            {"a": {"time": ramp, "signals": np.array([{"values": x, "label": "roll"} for x in (ramp, -ramp)])}},
            "two columns are called roll",
        ),
        (
            {"time": ramp, "pitch": ramp, "roll": ramp + 1j},
            r"roll is of type complex128 and shape \(9,\); save it as a",
        ),
        ({"time": ramp, "pitch": ramp, "roll": np.ones((9, 2))}, r"roll is of type float64 and shape \(9, 2\)"),
        ({"time": ramp, "pitch": ramp, "a": {"roll": "none"}}, r"a.roll is of type <U4 and shape \(\); save it as a"),
    ]:
        savemat(path, variables)
        with pytest.raises(prw.UserError, match=message):
            prw.check(path, fmu=fmu)
    savemat(path, {"roll": np.zeros(3)})
    with pytest.raises(prw.UserError, match="no vector time or tout; it has .*roll; save time and signals as vectors"):
        prw.check(path, fmu=fmu)
    with pytest.raises(prw.UserError, match="experiment: fig5 is not known; there are fig4_opposite, "):
        prw.check(path, "fig5", fmu=fmu)
    with pytest.raises(prw.UserError, match="absent.csv: no such file"):
        prw.check(tmp_path / "absent.csv", fmu=fmu)


def test_the_command(prw, right, soft, tmp_path):
    result = prw("check", write_csv(tmp_path / "right.csv", right))
    assert result.returncode == 0 and "agrees      with the reference" in result.stdout
    either = write_csv(
        tmp_path / "either.csv", {"time": right["time"], "a.roll": right["roll"], "b.roll": soft["roll"]}
    )
    assert "prw check: --component: there are several roll" in prw("check", either).stderr
    result = prw("check", write_csv(tmp_path / "soft.csv", soft), "--out", tmp_path / "out")
    assert result.returncode == 1 and "TOO FAR" in result.stdout and result.stderr.count("\n") == 1
    assert "too far from fig4_opposite" in result.stderr and (tmp_path / "out" / "soft_check.png").stat().st_size > 1000
