"""A result that cannot be written whole is not written at all."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

resource = pytest.importorskip("resource", reason="POSIX has limits on the size of files")

#: Enough for the unpacked FMU, too little for the table.
LIMIT = 4_000_000
ROWS = 40_000


@pytest.mark.parametrize("ended", [False, True], ids=["disk full", "killed"])
def test_the_old_result_stays(tmp_path, fmu, ended):
    recording = "".join(f"{k / 1000},{k / 7e6!r},{k / 3e6!r}\n" for k in range(ROWS))
    (tmp_path / "long.csv").write_text("time,theta1,theta2\n" + recording)
    old = tmp_path / "out" / "long.csv"
    old.parent.mkdir()
    old.write_text("old")

    # The signal that a file has become too large ends a process that does not ignore it, as Python does.
    handler = "signal.signal(signal.SIGXFSZ, signal.SIG_DFL); " if ended else ""
    start = f"import signal, sys, prw.cli; {handler}sys.exit(prw.cli.main(sys.argv[1:]))"
    command = [sys.executable, "-c", start, "simulate", "--input", "long.csv", "--fmu", str(fmu)]
    limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT, LIMIT))  # noqa: E731
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, preexec_fn=limit, timeout=120)

    assert old.read_text() == "old"
    left = [path.name for path in old.parent.iterdir() if path != old]
    if ended:
        assert result.returncode == -signal.SIGXFSZ
        assert all(name.startswith(".long-") for name in left)
    else:
        assert result.returncode == 1 and left == []
        assert "long.csv: cannot be written" in result.stderr and result.stderr.count("\n") == 1
