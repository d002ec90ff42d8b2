"""Reading recordings: units, formats, notes, and one line for each mistake."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pytest

import prw
from prw.errors import UserError
from prw.identification.experiment import prepare
from prw.recording import read, read_motion

GOOD = "time,theta1,theta2\n0,0.1,0.2\n0.001,0.1,0.2\n0.002,0.1,0.2\n"


def lines(header: str, rows: int = 30, row: str = "{t},0.1,0.2,{x}") -> str:
    return header + "\n" + "".join(row.format(t=k / 100, x=k % 7 / 10) + "\n" for k in range(rows))


@pytest.fixture
def file(tmp_path: Path) -> Any:
    def write(content: str | bytes) -> Any:
        path = tmp_path / "run.csv"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write


BAD = {
    "empty": (b"", "the file is empty"),
    "blank": (b"\n\n", "the file is empty"),
    "header only": (b"time,theta1,theta2\n", "row 1: no rows below the header"),
    "one row": (b"time,theta1,theta2\n0,1,1\n", "row 2: only one row below the header"),
    "missing column": (
        b"time,theta1,omega1\n0,1,1\n1,1,1\n",
        "row 1: column theta2 is missing; the header has time, theta1, omega1",
    ),
    "no header": (b"0,1,1\n1,1,1\n", "row 1: there is no header; it must have the columns time, theta1, theta2"),
    "half the rates": (
        b"time,theta1,theta2,omega2\n0,1,1,1\n1,1,1,1\n",
        "row 1: column omega1 is missing; give both omega1 and omega2, or neither",
    ),
    "spaces": (b"time theta1 theta2\n0 1 1\n1 1 1\n", "separate columns by comma, semicolon or tab"),
    "wrong unit": (
        b"time,theta1 [m],theta2\n0,1,1\n1,1,1\n",
        "row 1, column theta1: theta1 cannot be in 'm'; use rad, mrad",
    ),
    "duplicate column": (b"time,theta1,theta2,theta1\n0,1,1,1\n1,1,1,1\n", "row 1, column theta1: appears twice"),
    "short row": (b"time,theta1,theta2\n0,1,1\n1,1\n2,1,1\n", "row 3: 2 cells, but the header has 3"),
    "long row": (b"time,theta1,theta2\n0,1,1\n1,1,1,1\n", "row 3: 4 cells, but the header has 3"),
    "word": (b"time,theta1,theta2\n0,1,1\n1,1,fast\n", "row 3, column theta2: 'fast' is not a number"),
    "underscore": (b"time,theta1,theta2\n0,1,1\n1,1_0,1\n", "row 3, column theta1: '1_0' is not a number"),
    "empty cell": (b"time,theta1,theta2\n0,1,1\n1,,1\n", "row 3, column theta1: empty cell"),
    "nan": (b"time,theta1,theta2\n0,1,1\n1,NaN,1\n", "row 3, column theta1: NaN is not finite"),
    "infinite time": (b"time,theta1,theta2\n0,1,1\ninf,1,1\n", "row 3, column time: inf is not finite"),
    "time backwards": (
        b"time,theta1,theta2\n0,1,1\n2,1,1\n\n1.5,1,1\n",
        "row 5, column time: 1.5 runs backwards (after 2.0)",
    ),
    "time repeated": (
        b"time,theta1,theta2\n0,1,1\n0,1,1\n",
        "row 3, column time: 0 repeats the time of the previous row",
    ),
    "latin-1": ("time,theta1,theta2,größe\n0,1,1,1\n".encode("latin-1"), "row 1: not UTF-8 text"),
    "latin-1 later": ("time,theta1,theta2,x\n0,1,1,1\n1,1,1,ß\n".encode("latin-1"), "row 3: not UTF-8 text"),
    "utf-16 without its mark": (
        "time,theta1,ö\n0,1,1\n".encode("utf-16-le"),
        "this is not a text file, or it is UTF-16 without its byte order mark",
    ),
    "utf-16 without its mark, in which each byte is UTF-8": (
        "# log\ntime,theta1,theta2\n0,1,1\n".encode("utf-16-le"),
        "or it is UTF-16 without its byte order mark; save it as UTF-8 CSV, or name its encoding, such as latin-1",
    ),
    "a picture": (b"GIF89a\xd2\0\xff", "this is not a text file"),
    "prose": (b"Dear reader, this\n", "row 1: this is not a table of motor angles"),
    "nul": (b"time,theta1,theta2\n0,1,1\n1,\0,1\n", "row 3"),
    "decimal comma": (b"time\ttheta1\ttheta2\n0\t1\t1\n0,1\t1\t1\n", "row 3, column time: '0,1' is not a number"),
    "separators of thousands": (
        b"time;theta1;theta2;tau1\n0;0.1;0.1;1\n0.1;0.1;0.1;\n0.2;0.1;0.1;1,542\n",
        "row 4: decimal commas and decimal points are mixed from here on",
    ),
    "a quote that swallows rows": (
        b'time,theta1,theta2,note\n0,1,1,a\n1,1,1,"b\n2,1,1,c\n3,1,1,d"\n4,1,1,e\n',
        "row 3: a cell in quotes does not end in this row; close its quote, or write it in one row",
    ),
    "a quote that is not closed": (
        b'time,theta1,theta2\n0,1,1\n1,1,"1\n',
        "row 3: a cell in quotes does not end in this row",
    ),
    "counts that are no number": (
        "time,theta1 [rev/\u00b2],theta2\n0,1,1\n1,1,1\n".encode(),
        "row 1, column theta1: theta1 cannot be in 'rev/\u00b2'",
    ),
    "wrong unit of torque": (
        b"time,theta1,theta2,tau1 [deg]\n0,1,1,1\n1,1,1,1\n",
        "column tau1: tau1 cannot be in 'deg'; use N.m, mN.m",
    ),
    "wrong unit of time": (
        b"time [h],theta1,theta2\n0,1,1\n1,1,1\n",
        "row 1, column time: time cannot be in 'h'; use s, ms",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_recordings_that_cannot_be_read(file: Any, case: Any) -> None:
    content, message = BAD[case]
    path = file(content)
    with pytest.raises(UserError) as error:
        read(path)
    assert str(error.value).startswith(str(path)) and message in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    "content",
    [
        b"\xef\xbb\xbf" + GOOD.encode(),
        GOOD.replace("\n", "\r\n").encode(),
        GOOD.replace(",", ";").encode(),
        GOOD.replace(",", ";").replace(".", ",").encode(),
        GOOD.replace(",", "\t").encode(),
        b"sep=;\r\n" + GOOD.replace(",", ";").replace(".", ",").encode(),
        b'\xef\xbb\xbf# log\n"SEP=|"\n\n' + GOOD.replace(",", "|").encode(),
        GOOD.replace(",", " , ").encode(),
        b'"time","theta1","theta2"\n0,"0.1",0.2\n0.001,0.1,0.2\n0.002,0.1,0.2',
        b'# of the rig, "Anna\n' + GOOD.encode(),
        b"\n" + GOOD.encode() + b"\n\n",
        GOOD.encode() + b"  \t \n",
        GOOD.encode() + b" ,, \n,,\n",
        b"note,theta2,time,theta1\nstart,0.2,0,0.1\n,0.2,0.001,0.1\n,0.2,0.002,0.1\n",
    ],
    ids=[
        "bom",
        "crlf",
        "semicolons",
        "decimal commas",
        "tabs",
        "sep=;",
        "sep=|",
        "spaces",
        "quotes",
        "a quote in a comment",
        "blank lines",
        "a line of blanks",
        "lines of blank cells",
        "other columns",
    ],
)
def test_spellings_of_one_recording(file: Any, content: Any) -> None:
    motion = read_motion(file(content))
    np.testing.assert_array_equal(motion.time, [0, 0.001, 0.002])
    np.testing.assert_array_equal(motion.theta, [[0.1, 0.2]] * 3)
    assert any("columns ignored: note" in note for note in motion.notes) == (b"note" in content)


@pytest.mark.parametrize("delimiter, end", [(",", "\n"), (";", "\r\n"), ("\t", "\n")])
def test_numbers_of_many_rows(tmp_path: Path, delimiter: Any, end: Any) -> None:
    """Numbers are bit-identical to Python's conversion of each cell, also next to empty cells and columns of strings. Errors
    name the row."""
    draws = np.random.default_rng(6)
    numbers = draws.standard_normal((500, 5)) * 10.0 ** draws.integers(-310, 300, (500, 5))
    cells = [[repr(k * 1e-3), "up", *map(repr, row.tolist())] for k, row in enumerate(numbers)]
    for row in cells[::3]:
        row[5:] = ["", "nan"]
    if delimiter == ";":
        cells = [[cell.replace(".", ",") for cell in row] for row in cells]
    header = ["time", "state", "theta1", "theta2", "x", "tau1", "pitch"]
    path = tmp_path / "run.csv"

    def write() -> None:
        path.write_bytes(end.join(delimiter.join(row) for row in [header, *cells, []]).encode())

    write()
    recording = read(path, degrees=False)
    expected = np.array([[float(cell.replace(",", ".") or "nan") for cell in row[2:]] for row in cells])
    np.testing.assert_array_equal(recording["theta1"], expected[:, 0])
    np.testing.assert_array_equal(recording["tau1"], expected[:, 3])
    np.testing.assert_array_equal(recording["pitch"], expected[:, 4])
    for column, cell, message in [
        (2, "", "row 402, column theta1: empty cell"),
        (2, "1_0", "row 402, column theta1: '1_0' is not a number"),
        (3, "inf", "row 402, column theta2: inf is not finite"),
        (0, "0", "row 402, column time: 0 runs backwards"),
        (1, f"up{delimiter}", "row 402: 8 cells, but the header has 7"),
    ]:
        before, cells[400][column] = cells[400][column], cell
        write()
        with pytest.raises(UserError, match=re.escape(message)):
            read(path)
        cells[400][column] = before


def test_units_of_the_header_and_of_the_option(file: Any) -> None:
    path = file(
        "time [ms],theta1 (deg),theta2 [rev],omega1_rpm,omega2,tau1,pitch\n0,180,2,30,0,1,6\n5,180,2,30,0,1,6\n"
    )
    measured, motion = read(path, units={"pitch": "mrad"}), read_motion(path)
    for time, theta, omega in ((m.time, m.theta, m.omega) for m in (measured, motion)):
        np.testing.assert_allclose(time, [0, 5e-3], rtol=1e-15)
        np.testing.assert_allclose(theta, [[np.pi, 4 * np.pi]] * 2, rtol=1e-15)
        assert omega is not None
        np.testing.assert_allclose(omega, [[np.pi, 0]] * 2, rtol=1e-15)
    assert measured["pitch"][1] == pytest.approx(6e-3) and list(measured.measured) == ["tau1", "pitch"]
    assert "columns ignored: tau1, pitch" in motion.notes
    assert read(path)["pitch"][1] == 6 and read(path, degrees=True)["pitch"][1] == pytest.approx(np.deg2rad(6))
    for unit, factor in {"N.m": 1, "Nm": 1, "N·m": 1, "mN.m": 1e-3, "N cm": 1e-2}.items():
        assert read(path, units={"tau1": unit})["tau1"][1] == pytest.approx(factor)
    with pytest.raises(UserError, match="column theta1: the header has the unit deg, but `units` has rad"):
        read(path, units={"theta1": "rad"})


@pytest.mark.parametrize(
    "header",
    ["t_ms,theta1_deg,theta2/deg,tau1_Nm,pitch_rate_wanted", "# Time (ms),THETA1 deg,theta2 [°],Tau1/N.m,tau1_raw"],
)
def test_headers_as_others_write_them(file: Any, header: Any) -> None:
    """Units may follow `_`, `/` or a space; capitals and NumPy's `#` before the header are ignored. Other suffixes belong to the name."""
    path = file("# rig 2; 13 May\n\n" + lines(header, row="{t},0.1,0.2,{x},0"))
    measured = read(path)
    assert measured.time[-1] == pytest.approx(0.29e-3)
    np.testing.assert_allclose(measured.theta[0], np.deg2rad([0.1, 0.2]))
    assert list(measured.measured) == ["tau1"] and measured["tau1"][6] == pytest.approx(0.6)
    assert measured.notes[0] == f"columns ignored: {header.rsplit(',', 1)[1]}"
    path.write_text(path.read_text().replace("0.29,", "oops,"))
    with pytest.raises(UserError, match="row 33, column time: 'oops' is not a number"):
        read(path)


def test_headers_of_other_tools(tmp_path: Path) -> None:
    """Reads a file with a preamble, other names with units, counts of an encoder, and encodings other than UTF-8."""
    rows = "".join(f"{k / 100};{k};{2 * k};{k % 7}\n" for k in range(30))
    path = tmp_path / "run.csv"
    path.write_text("type;float\ncapture;2026\n\nX;Motor 1;Motor 2;T [mNm]\n" + rows, encoding="utf-16")
    names = {"time": "X", "theta1": "Motor 1", "theta2": "Motor 2", "tau1": "T"}
    counted = {"theta1": "rev/10000", "theta2": "rev/10000"}
    measured = read(path, counted, names=names, skip=2)
    np.testing.assert_allclose(measured.theta[29], np.array([29, 58]) * 2 * np.pi / 10000)
    assert measured["tau1"][6] == pytest.approx(6e-3) and measured.time[-1] == pytest.approx(0.29)
    path.write_text(path.read_text(encoding="utf-16"), encoding="latin-1")
    assert read(path, counted, names=names, skip=2, encoding="latin-1").time[-1] == pytest.approx(0.29)
    with pytest.raises(UserError, match="row 4: no column 'Motor 3'; the header has X, Motor 1"):
        read(path, names={"theta1": "Motor 3"}, skip=2)
    with pytest.raises(UserError, match="row 4: no column 'Mot'; the header has X, Motor 1"):
        read(path, names={**names, "roll": "Mot"}, skip=2)
    with pytest.raises(UserError, match="names: .* names one column twice"):
        read(path, names={**names, "roll": "T"}, skip=2)
    with pytest.raises(UserError, match="recording: no column roll, whose unit is given; there are time, theta1"):
        read({"time": [0, 1], "theta1": [0, 0], "theta2": [0, 0]}, units={"roll": "deg"})
    with pytest.raises(UserError, match="skip 1.5: must be an integer of at least 0"):
        read(path, skip=1.5)  # type: ignore[arg-type]
    with pytest.raises(UserError, match="names: tau3 is not known"):
        read(path, names={"tau3": "X"})
    with pytest.raises(UserError, match="encoding: 'utf-7000' is not known"):
        read(path, encoding="utf-7000")


def test_degrees(file: Any) -> None:
    path = file("time,theta1,theta2,omega1,omega2\n0,40,-10,0,0\n0.1,43,-10,60,0\n")
    motion = read_motion(path, degrees=True)
    np.testing.assert_allclose(motion.theta, np.deg2rad([[40, -10], [43, -10]]), rtol=1e-15)
    assert motion.omega is not None
    np.testing.assert_allclose(motion.omega, np.deg2rad([[0, 0], [60, 0]]), rtol=1e-15)
    assert motion.notes == []
    # Without a unit, an implausible motion is rejected, because nobody knows whether it is in degrees or in radians.
    with pytest.raises(
        UserError, match=r"theta1 reaches 43 rad .* --radians \(in Python prw\.read\(path, degrees=True"
    ):
        read_motion(path)
    assert any("theta1 reaches 43 rad" in note for note in read_motion(path, degrees=False).notes)


@pytest.mark.parametrize(
    "text, message",
    [
        (lines("time,theta1,theta2,x"), "run.csv: nothing measured; at least one column of tau1, tau2"),
        (lines("time,theta1,theta2,tau1", 10), "column tau1: 10 values; at least 20 are needed"),
    ],
)
def test_too_few_measurements(file: Any, text: Any, message: Any) -> None:
    with pytest.raises(UserError, match=message):
        prepare(read(file(text)))


T = np.arange(0, 1, 0.01)
ROWS = "\n".join(f"{t},{1 - np.cos(3 * t)},{np.rad2deg(3 * np.sin(3 * t))},0,0" for t in T)


@pytest.mark.parametrize(
    "text, note",
    [
        (
            "theta2\n0,3.1,0\n0.01,3.14,0\n0.02,-3.13,0\n0.03,-3.1,0\n",
            "theta1 restarts after full turns, first after 0.01 s; it was continued without the jumps",
        ),
        (
            "theta2\n0,0,0\n0.01,4,0\n0.02,4,0\n",
            "theta1 jumps by 4 rad after 0 s; angles must continue past a full turn",
        ),
        ("theta2\n0,0,0\n10,0.1,0\n20,0.2,0\n", "a sample every 10 s; if time is in ms, call its column time [ms]"),
        (
            "theta2\n1700000000.001,0,0\n1700000000.002,0,0\n1700000000.003,0,0\n",
            "time reaches 1.7e+09 s, where it can only be resolved to 2.4e-07 s, 0.00024 of a step; subtract the first",
        ),
        ("omega1,theta2,omega2\n" + ROWS, "omega1 adds up to 57.3 times the motion of theta1"),
    ],
)
def test_probable_mistakes_are_noted(file: Any, text: Any, note: Any) -> None:
    assert any(note in found for found in read(file("time,theta1," + text)).notes)


def moving(rows: Any) -> str:
    return "time,theta1,theta2,tau1\n" + "".join(f"{k / 1000},{np.sin(k / 100)},0.1,{k % 7}\n" for k in rows)


def test_a_gap_is_an_error_or_a_note(file: Any) -> None:
    """Motor motion in a gap of 0.2 s is unknown, which is an error. A smooth path bridges a gap of 20 ms. If the motors rest in
    a gap of 0.2 s, there is only a note."""
    with pytest.raises(UserError, match=r"no rows from 0.299 to 0.5 s, 0.201 s instead of the usual 0.001 s"):
        read_motion(file(moving([*range(300), *range(500, 900)])))
    measured = read(file(moving([*range(300), *range(320, 900)])))
    assert measured.notes[0] == "rows are missing once, for up to 0.021 s after 0.299 s; a smooth path bridges that"
    assert not any("missing" in note for note in read(file(moving(range(0, 900, 3)))).notes)
    still = [f"{k / 1000},0.1,0.1,{k % 7}" for k in [*range(300), *range(500, 900)]]
    assert "rows are missing once" in read(file("\n".join(["time,theta1,theta2,tau1", *still]))).notes[0]


def test_a_recording_with_measurements(tmp_path: Path) -> None:
    path = tmp_path / "rig.csv"
    path.write_text("time [ms],theta1,theta2,tau1 [mN.m],pitch,site\n0,1,2,3,90,a\n5,1,2,,90,b\n10,1,2,5,90,c\n")
    recording = read(path, units={"pitch": "deg"})
    assert set(recording.measured) == {"tau1", "pitch"} and recording.omega is None and recording.name == "rig"
    np.testing.assert_allclose(recording["time"], [0, 5e-3, 1e-2], rtol=1e-15)
    np.testing.assert_allclose(recording["tau1"], [3e-3, np.nan, 5e-3])
    np.testing.assert_allclose(recording["pitch"], np.pi / 2, rtol=1e-15)
    np.testing.assert_array_equal(recording["theta2"], 2)
    assert recording.units == {"time": "ms", "theta1": "rad", "theta2": "rad", "tau1": "mN.m", "pitch": "deg"}
    assert any("columns ignored: site" in note for note in recording.notes) and "rig" in repr(recording)
    np.testing.assert_allclose(read(path, degrees=True).theta, np.deg2rad([[1, 2]] * 3), rtol=1e-15)
    with pytest.raises(KeyError, match="roll: was not recorded; there are time, theta1, theta2, "):
        recording["roll"]
    with pytest.raises(UserError, match="units: yaw is not known; there are time, theta1"):
        read(path, units={"yaw": "deg"})
    # A simulation compares the measurements, so it rejects a damaged one, too. The motors can be read without them.
    path.write_text(path.read_text().replace(",3,", ",broken,"))
    for reader in (read, prw.simulate):
        with pytest.raises(UserError, match="rig.csv, row 2, column tau1: 'broken' is not a number"):
            reader(path)
    assert prw.simulate(read_motion(path))["roll"].shape == (3,)


def test_columns_in_memory(testbed: Path, tmp_path: Path) -> None:
    """A dict, a DataFrame and the CSV file that the DataFrame writes give the same recording, also with the time as index."""
    time = np.arange(4) * 1e-3
    table: dict[str, Any] = {
        "time": time,
        "theta1 [deg]": time * 90,
        "theta2": -time,
        "tau1": [1, None, 2, 3],
        "x": "abcd",
    }
    frame = pandas.DataFrame({**table, "x": list("abcd")})
    frame.to_csv(tmp_path / "recording.csv", index=False)
    from_file = read(tmp_path / "recording.csv")
    masked = table | {"tau1": np.ma.array([1, 9, 2, 3], mask=[False, True, False, False])}
    integers = pandas.array([1, None, 2, 3], dtype="Int64")
    nullable, mixed = frame.assign(tau1=integers), frame.assign(tau1=integers.astype(object))
    for source in (table, masked, frame, frame.set_index("time"), frame.set_index("time", drop=False), nullable, mixed):
        recording = read(source)
        for name in ("time", "theta1", "theta2", "tau1"):
            np.testing.assert_array_equal(recording[name], from_file[name])
        assert (recording.units, recording.notes) == (from_file.units, from_file.notes)
        assert prw.simulate(source, fmu=testbed)["roll"][-1] == prw.simulate(from_file, fmu=testbed)["roll"][-1]
    run = prw.simulate(frame, fmu=testbed)
    for again in (prw.simulate(run, fmu=testbed), prw.simulate(run.to_pandas(), fmu=testbed)):
        np.testing.assert_array_equal(again["tau1"], run["tau1"])
    good = {"time": [0.0, 1.0], "theta1": [0.0, 1.0], "theta2": [0.0, 1.0]}
    wrong: list[tuple[Any, str]] = [
        ({"time": [0.0, 1.0]}, "recording: column theta1 is missing; the header has time"),
        ({**good, "theta2": [0.0, None]}, "recording, column theta2: nan at index 1 is not finite"),
        ({**good, "theta2": np.ma.array([0.0, 9.0], mask=[False, True])}, "theta2: nan at index 1 is masked"),
        ({**good, "theta2": ["a", "b"]}, "recording, column theta2: does not consist of numbers"),
        ({**good, "theta2": ["0", "1_000"]}, "theta2: does not consist of numbers; convert strings"),
        ({**good, "theta2": pandas.Series([0, "1"])}, "theta2: does not consist of numbers; convert strings"),
        ({**good, "theta2": [False, True]}, "theta2: does not consist of numbers; convert strings and Booleans"),
        ({**good, "theta2": [False, 1.0]}, "theta2: does not consist of numbers; convert strings and Booleans"),
        ({**good, "theta2": np.array([np.True_, 1.0], dtype=object)}, "theta2: does not consist of numbers; convert"),
        ({**good, "theta2": np.ma.array(["0", "1_000"])}, "theta2: does not consist of numbers; convert strings"),
        ({**good, "theta2": np.ma.array([True, False])}, "theta2: does not consist of numbers; convert strings"),
        ({**good, "theta2": np.array([0.0, 1j])}, "theta2: has complex numbers; choose their real part"),
        ({**good, "time": np.ma.array([0, 1], dtype="m8[s]")}, "column time: has dates"),
        (pandas.DataFrame(good, index=pandas.Index([0.0, 2.0], name="time")), "the index and a column .* called time"),
        ({**good, "theta2": pandas.array([0, None], dtype="Int64")}, "theta2: nan at index 1 is not finite"),
        ({**good, "theta2": ([0.0, 1.0], "deg")}, "recording, column theta2: is a pair of values and a unit"),
        ({**good, "theta2": [[0.0], [1.0, 2.0]]}, "recording, column theta2: does not consist of numbers"),
        ({**good, "theta2": [0.0]}, "recording, column theta2: has 1 rows, but time has 2"),
        ({**good, "theta2": [[0.0], [1.0]]}, r"recording, column theta2: has the shape \(2, 1\)"),
        ({**good, "time": pandas.to_datetime(["2026-01-01", "2026-01-02"])}, "column time: has dates"),
        ({**good, "time": [1.0, 0.0]}, "recording, column time: time must increase"),
        (dict.fromkeys(good, [0.0]), "recording: has 1 rows; at least two are needed"),
        ({**good, "theta1 [deg]": [0.0, 1.0]}, "recording, column theta1: appears twice"),
        ({}, "must have the columns time, theta1, theta2, but it has none"),
        (None, "None is not a recording: neither a file nor a DataFrame"),
    ]
    for source, message in wrong:
        with pytest.raises(UserError, match=message):
            read(source)
    options: list[tuple[dict[str, Any], str]] = [
        ({"skip": 1}, "belongs to a file; this is a table in memory"),
        ({"encoding": "latin-1"}, "belongs to a file; this is a table in memory"),
        ({"skip": True}, "skip True: must be an integer of at least 0"),
        ({"degrees": "no"}, "degrees 'no': must be True or False"),
    ]
    for option, message in options:
        with pytest.raises(UserError, match=message):
            read(good, **option)
