"""What is in dist/ is all of one release: what is missing or of another version is an error, what was there before is gone."""

from __future__ import annotations

from pathlib import Path

import prw_wheel
import pytest
import release
import wheels
from targets import TARGETS


def test_nothing_is_left_of_an_earlier_release(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(release, "DIST", tmp_path / "dist")
    for version in ("0.1.0", "0.2.0"):
        made = tmp_path / "made" / version / "dist"
        made.mkdir(parents=True)
        (made / f"prw-{version}-py3-none-any.whl").write_text(version)
        (made / release.SUMS).write_text(release.checksums(made))
        release.put(made)
        names = [f"prw-{version}-py3-none-any.whl", release.SUMS]
        assert sorted(path.name for path in release.DIST.iterdir()) == sorted(names)
        assert (release.DIST / release.SUMS).read_text().endswith(f"  prw-{version}-py3-none-any.whl\n")


def test_a_wheel_for_each_platform(tmp_path: Path) -> None:
    names = [f"fmu_run-0.2.0-cp311-abi3-{target.wheel}.whl" for target in TARGETS]
    for name in (*names, "fmu_run-0.1.0-cp311-abi3-win_amd64.whl"):
        (tmp_path / name).touch()
    assert [path.name for path in wheels.found(tmp_path, "0.2.0")] == names
    with pytest.raises(SystemExit, match="one wheel of fmu-run 0.1.0 for manylinux_2_17_x86_64, not 0"):
        wheels.found(tmp_path, "0.1.0")
    (tmp_path / "fmu_run-0.2.0-cp312-abi3-win_amd64.whl").touch()
    with pytest.raises(SystemExit, match="one wheel of fmu-run 0.2.0 for win_amd64, not 2"):
        wheels.found(tmp_path, "0.2.0")


def test_prw_has_the_version_of_the_rest() -> None:
    with pytest.raises(SystemExit, match=r"in python/prw/pyproject.toml is [\d.]+, in Cargo.toml it is 9.9.9"):
        prw_wheel.check_version("9.9.9")
