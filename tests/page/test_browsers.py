"""Opens the page in the FMU from a file in real browsers. Results are bit-identical to the library, and nothing is requested."""

from __future__ import annotations

import csv
import io
import json
import os
import queue
import re
import signal
import subprocess
import sys
import threading
import zipfile
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import toolchain
from built import SCRIPT, built, script_of
from fmpy import read_model_description
from fmu_run import Fmu

from prw.checking.experiments import read_experiments

INPUTS = ("theta1", "theta2", "omega1", "omega2")
CONTROLLED = {"pitch_ref", "roll_ref", "pitch", "roll", "pitch_rate", "roll_rate", "tau1", "tau2"}
WEBKIT = "/usr/lib/x86_64-linux-gnu/webkit2gtk-4.1/MiniBrowser"
#: Functions of a directory and a width in pixels that return a command: it starts a browser with a new profile in the directory, in a
#: window of this width.
BROWSERS = {
    "chromium": lambda home, width: [
        *("chromium", "--headless=new", "--no-sandbox", f"--user-data-dir={home}", f"--window-size={width},1000"),
    ],
    "firefox": lambda home, width: [
        "firefox-esr",
        "--headless",
        "--profile",
        str(home),
        "--width",
        str(width),
        "--height",
        "1000",
    ],
    "webkit": lambda home, width: [
        "xvfb-run",
        "-a",
        "-s",
        f"-screen 0 {width}x1000x24",
        WEBKIT,
        "--private",
        f"--geometry={width}x1000",
    ],
}
WIDTHS = {"chromium": 360, "firefox": 1000, "webkit": 2000}


@pytest.fixture(scope="module")
def reports() -> Iterator[tuple[str, queue.Queue[Any]]]:
    """Returns the address to which pages send their reports, and the queue of reports."""
    reported: queue.Queue[Any] = queue.Queue()

    class Listener(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            reported.put(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            self.send_response(204)
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    server = HTTPServer(("127.0.0.1", 0), Listener)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/", reported
    server.shutdown()


@pytest.fixture(scope="module", params=BROWSERS)
def report(request: pytest.FixtureRequest, fmu: Path, reports: Any, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Returns the report of a browser that has opened the page."""
    directory = tmp_path_factory.mktemp(request.param)
    command = BROWSERS[request.param](directory / "home", WIDTHS[request.param])
    toolchain.need(command[0], *([WEBKIT] if WEBKIT in command else []))
    (directory / "home").mkdir()
    page = directory / "index.html"
    page.write_text(with_visitor(fmu, reports[0]), encoding="utf-8")
    # A separate process group, so that the browser ends with all processes that it starts.
    quiet: Any = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "start_new_session": True}
    with subprocess.Popen([*command, page.as_uri()], **quiet) as browser:
        try:
            return reports[1].get(timeout=180)
        finally:
            os.killpg(browser.pid, signal.SIGTERM)


def with_visitor(fmu: Path, address: str) -> str:
    """Returns the page with the reference experiments as motions, and with the script of a visitor."""
    with zipfile.ZipFile(fmu) as archive:
        page = archive.read("documentation/index.html").decode()
    # The content security policy is removed, because it only allows the page's own scripts.
    page, count = re.subn(r'<meta http-equiv="Content-Security-Policy"[^>]*>', "", page)
    assert count == 1
    experiments = read_experiments(fmu)
    motions = []
    for one in experiments:
        times = 1e-3 * np.arange(round(one.stop_time / 1e-3) + 1)
        rows = np.column_stack([np.interp(times, one.inputs["time"], one.inputs[name]) for name in INPUTS])
        motions.append({"id": one.name, "length": one.stop_time, "rows": rows.tolist()})
    given = (
        f"MOTIONS.push(...{json.dumps(motions)}.map(({{id, length, rows}}) => ({{id, title: id, length, "
        "inputs: (time, inputs) => [inputs.theta1, inputs.theta2, inputs.omega1, inputs.omega2] = "
        "rows[Math.round(time / 1e-3)]})));\n"
    )
    script = script_of(page)
    begin = script.index("live([\n{ description")
    page = SCRIPT.sub(lambda _: f"\n{script[:begin]}{given}{script[begin:]}", page)
    end = page.rindex("</body>")
    settings = {one.name: {name: float(value) for name, value in one.parameters.items()} for one in experiments}
    values = f"window.settings = {json.dumps(settings)}; window.address = {json.dumps(address)};"
    visitor = Path(__file__).with_name("inside.js").read_text(encoding="utf-8")
    return f"{page[:end]}<script>{values}\n{visitor}</script>{page[end:]}"


def test_the_browser_is_bit_identical_to_the_library(fmu: Path, report: Any) -> None:
    """Compares the CSV files of the reference experiments, of the page's motions, and of a run with a motor moved by hand with the
    library."""
    assert report["errors"] == []
    assert {one.name for one in read_experiments(fmu)} | {
        "one",
        "tour",
        "stop",
        "fig4",
        "chirp",
        "closed-loop",
        "open-loop",
        "hand",
    } <= set(report["runs"])
    with Fmu(fmu) as loaded:
        for name, run in report["runs"].items():
            header, *lines = csv.reader(line for line in io.StringIO(run["csv"]) if not line.startswith("#"))
            rows = np.array(lines, dtype=np.float64)
            assert header[:5] == ["time", *INPUTS] and len(rows) > 400, name
            if "pitch_ref" in header:
                header, rows = header[:-4], without_controller(rows, header, name)
            types = {one: loaded.variables[one].type for one in run["parameters"]}
            start = {k: v if types[k] in ("Real", "Float64") else int(v) for k, v in run["parameters"].items()}
            start = {k: bool(v) if types[k] == "Boolean" else v for k, v in start.items()}
            library = loaded.instances(start=start)
            for number, row in enumerate(rows):
                library.set(INPUTS, row[1:5])
                np.testing.assert_array_equal(library.get(header[5:])[0], row[5:], f"{name}, {row[0]} s")
                if number + 1 < len(rows):
                    library.step(to=rows[number + 1, 0])


def without_controller(rows: np.ndarray, header: list[str], name: str) -> np.ndarray:
    """Returns the rows without the setpoints and the slip of motor 2. Checks that the controller FMU returns the motor motion in the
    rows, to which the slip is added."""
    gains = {"Kp": 0.0, "Ki": 0.0, "Kd": 0.0} if name == "open-loop" else {"Ki": 20.0}
    slip = rows[:, [header.index("slip"), header.index("slip_rate")]]
    read = [index for index, one in enumerate(header) if one in CONTROLLED]
    with Fmu(built("prw_controller.fmu")) as loaded:
        controller = loaded.instances(start=gains)
        for number, row in enumerate(rows):
            motors = controller.get(INPUTS)[0]
            motors[[1, 3]] += slip[number]
            np.testing.assert_array_equal(motors, row[1:5], f"the controller, {name}, {row[0]} s")
            controller.set([header[index] for index in read], row[read])
            if number + 1 < len(rows):
                controller.step(to=rows[number + 1, 0])
    return rows[:, :-4]


def test_the_page_shows_the_machine_sends_no_requests_and_fits(fmu: Path, report: Any) -> None:
    # The labels alone cover less.
    assert report["painted"] > 0.1
    assert report["requests"] == 0
    assert not report["wide"]
    assert report["guid"] == read_model_description(str(fmu)).guid
    print(
        report["agent"],
        f"{report['first']:.0f} ms to the first movement, {report['frames']:.0f} frames per second",
        file=sys.stderr,
    )


def test_a_motor_moved_by_hand_and_a_rejected_value(report: Any) -> None:
    assert report["motion"] == "hand"
    assert not report["reduced"] or report["waits"]
    assert report["error"] == "k1 must be greater than 0\u00a0N·m/°, but it is −1\u00a0N·m/°"
    assert "motion=hand" in report["link"] and "k1=114.59" in report["link"] and "theta1=0.5235" in report["link"]
