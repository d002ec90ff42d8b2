"""Reading measurements: units from header or option, gaps, and one clear line for everything that can be wrong."""

from __future__ import annotations

import numpy as np
import pytest

from prw.errors import UserError
from prw.identification.experiment import prepare
from prw.recording import read, read_motion


def lines(header: str, rows: int = 30, row: str = "{t},0.1,0.2,{x}") -> str:
    return header + "\n" + "".join(row.format(t=k / 100, x=k % 7 / 10) + "\n" for k in range(rows))


@pytest.fixture
def file(tmp_path):
    def write(text: str):
        path = tmp_path / "run.csv"
        path.write_text(text)
        return path

    return write


def test_units_of_the_header_and_of_the_option(file):
    path = file(lines("time [ms],theta1 (deg),theta2 [rev],pitch"))
    measured = read(path, units={"pitch": "mrad"})
    assert measured.time[-1] == pytest.approx(0.29e-3)
    np.testing.assert_allclose(measured.theta[0], [np.deg2rad(0.1), 0.4 * np.pi])
    assert measured["pitch"][6] == pytest.approx(0.6e-3)
    assert list(measured.measured) == ["pitch"]
    assert read(path)["pitch"][6] == pytest.approx(0.6)
    assert read(path, degrees=True)["pitch"][6] == pytest.approx(np.deg2rad(0.6))


@pytest.mark.parametrize("unit, factor", [("N.m", 1), ("Nm", 1), ("N·m", 1), ("mN.m", 1e-3), ("N cm", 1e-2)])
def test_torque_units(file, unit, factor):
    measured = read(file(lines(f"time,theta1,theta2,tau1 [{unit}]")))
    assert measured["tau1"][6] == pytest.approx(0.6 * factor)


@pytest.mark.parametrize(
    "header",
    ["t_ms,theta1_deg,theta2/deg,tau1_Nm,pitch_rate_wanted", "# Time (ms),THETA1 deg,theta2 [°],Tau1/N.m,tau1_raw"],
)
def test_headers_as_others_write_them(file, header):
    """Units after `_`, `/` or a space, capitals, numpy's `#` before the header; what is no unit is another thing."""
    path = file("# rig 2; 13 May\n\n" + lines(header, row="{t},0.1,0.2,{x},0"))
    measured = read(path)
    assert measured.time[-1] == pytest.approx(0.29e-3)
    np.testing.assert_allclose(measured.theta[0], np.deg2rad([0.1, 0.2]))
    assert list(measured.measured) == ["tau1"] and measured["tau1"][6] == pytest.approx(0.6)
    assert measured.notes[0] == f"columns ignored: {header.rsplit(',', 1)[1]}"
    path.write_text(path.read_text().replace("0.29,", "oops,"))
    with pytest.raises(UserError, match="row 33, column time: 'oops' is not a number"):
        read(path)


def test_a_slow_sensor_leaves_cells_empty(file):
    text = lines("time,theta1,theta2,pitch,tau1", 60, "{t},0.1,0.2,,{x}").splitlines()
    for k in range(1, 61, 2):
        text[k] = text[k].replace(",,", f",{k / 100},")
    measured = read(file("\n".join(text)))
    assert {name: np.isfinite(column).sum() for name, column in measured.measured.items()} == {"tau1": 60, "pitch": 30}


@pytest.mark.parametrize(
    "text, message",
    [
        (lines("time,theta1,theta2,x"), "run.csv: nothing measured; at least one column of tau1, tau2"),
        (lines("time,theta1,pitch,x"), "row 1: column theta2 is missing; the header has time, theta1, pitch, x"),
        (lines("time,theta1,theta2,tau1 [deg]"), "row 1, column tau1: tau1 cannot be in 'deg'; use N.m, mN.m"),
        (lines("time [h],theta1,theta2,tau1"), "row 1, column time: time cannot be in 'h'; use s, ms"),
        (lines("time,theta1,theta2,omega1"), "column omega2 is missing; give both omega1 and omega2"),
        (lines("time,theta1,theta1 [deg],tau1"), "row 1, column theta1: appears twice in the header"),
        (
            lines("time,theta1,theta2,tau1").replace("0.13,0.1,0.2,0.6", "0.13,0.1,0.2,oops"),
            "row 15, column tau1: 'oops'",
        ),
        (lines("time,theta1,theta2,tau1").replace("0.13,0.1,", "0.13,,"), "row 15, column theta1: empty cell"),
        (
            lines("time,theta1,theta2,tau1").replace("0.13,0.1", "0.11,0.1"),
            "row 15, column time: 0.11 runs backwards",
        ),
        (lines("time,theta1,theta2,tau1", 10), "column tau1: 10 values; at least 20 are needed"),
    ],
)
def test_what_is_wrong_is_said(file, text, message):
    with pytest.raises(UserError) as error:
        prepare(read(file(text)))
    assert message in str(error.value) and "\n" not in str(error.value)


def test_units_that_contradict(file):
    with pytest.raises(UserError, match="column pitch: in deg by its header, but in rad by the units given"):
        read(file(lines("time,theta1,theta2,pitch [deg]")), units={"pitch": "rad"})


def moving(rows) -> str:
    return "time,theta1,theta2,tau1\n" + "".join(f"{k / 1000},{np.sin(k / 100)},0.1,{k % 7}\n" for k in rows)


def test_a_gap_is_refused_or_told(file):
    """By all that read recordings. The motors may have done anything in 0.2 s; a path goes through 20 ms."""
    with pytest.raises(UserError, match=r"no rows from 0.299 to 0.5 s, 0.201 s where 0.001 s is usual"):
        read_motion(file(moving([*range(300), *range(500, 900)])))
    measured = read(file(moving([*range(300), *range(320, 900)])))
    assert measured.notes[0] == "rows are missing once, for up to 0.021 s after 0.299 s; a smooth path bridges that"
    assert not any("missing" in note for note in read(file(moving(range(0, 900, 3)))).notes)
    still = [f"{k / 1000},0.1,0.1,{k % 7}" for k in [*range(300), *range(500, 900)]]
    assert "rows are missing once" in read(file("\n".join(["time,theta1,theta2,tau1", *still]))).notes[0]


def test_headers_of_other_tools(tmp_path):
    """A preamble, other names with units, an encoder's counts, and the encoding that Excel writes."""
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
    with pytest.raises(UserError, match="names: tau3 is not known"):
        read(path, names={"tau3": "X"})
    with pytest.raises(UserError, match="encoding: 'utf-7000' is not known"):
        read(path, encoding="utf-7000")
