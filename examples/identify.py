"""Stiffness and damping of your wrist from a recording, in ten lines

You learn to estimate parameters from recorded sensor signals, with standard errors and 95 % intervals, and to read the
report. A simulated rig replaces the real one, so the true values are known.

    make examples; .venv/bin/python examples/identify.py
"""

import subprocess
import sys
from pathlib import Path

import prw

HERE = Path(__file__).parent


def record(run: Path) -> str:
    """Write the sensor signals of a simulated rig in point-to-point moves; returns the printed message, which
    ends with the rig's parameters."""
    run.parent.mkdir(parents=True, exist_ok=True)
    paths = map(str, (HERE / "pretend_rig.py", HERE / "point_to_point.csv", run))
    command = [sys.executable, *paths, "--seed", "7", "--noise", "1"]
    return subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout


def main(out: Path = Path("out/identify")) -> prw.Identification:
    """Record, estimate, print and write the report; returns the estimate."""
    print(record(out / "run.csv").partition("; ")[2].strip())
    found = prw.identify(out / "run.csv")
    for name, estimate in found.parameters.items():
        low, high = estimate.interval
        print(
            f"{name}: {estimate.value:.4g} +- {estimate.standard_error:.2g} {estimate.unit}, 95 % interval {low:.4g} to {high:.4g}"
        )
    print(found.summary())
    found.report(out / "report.html")
    return found


if __name__ == "__main__":
    main()
