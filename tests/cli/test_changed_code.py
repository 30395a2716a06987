"""A run whose tracker has been edited since is refused, or run again with --refresh."""

from pathlib import Path

import pytest

from tests.cli.test_cli import FAILING, SMALL, pftrack_sim


@pytest.mark.slow
def test_changed_code_is_not_mistaken_for_the_code_that_ran(tmp_path: Path):
    module = tmp_path / "changing_tracker.py"
    source = FAILING.replace("if self.frame == 3: FAULT", "self.box = self.box + SHIFT")
    command = [
        "bench",
        "plaza-walk",
        "--trackers",
        "changing_tracker:make,stay",
        "--seeds",
        "0",
        "--out",
        "run",
        *SMALL,
    ]
    sql = "SELECT mean_overlap FROM summary WHERE tracker = 'changing_tracker:make'"

    def overlap() -> float:
        return float(pftrack_sim("query", str(tmp_path / "run"), sql, "--format", "csv").stdout.split()[-1])

    module.write_text(source.replace("SHIFT", "0.0"))
    assert pftrack_sim(*command, cwd=tmp_path).returncode == 0
    before = overlap()
    assert pftrack_sim(*command, cwd=tmp_path).returncode == 0
    module.write_text(source.replace("SHIFT", "[1.0, 0.0, 0.0, 0.0]"))
    stale = pftrack_sim(*command, cwd=tmp_path)
    assert stale.returncode == 2
    assert "begun with other code" in stale.stderr
    assert "code.changing_tracker:make" in stale.stderr
    assert overlap() == before
    assert pftrack_sim(*command, "--refresh", cwd=tmp_path).returncode == 0
    assert overlap() < before
    assert pftrack_sim("check", "run", cwd=tmp_path).returncode == 0
