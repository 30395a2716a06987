"""Single-bit flips in every file of a run folder: found by `check`, and read by nobody in silence."""

import contextlib
import os
import random
import shutil
import sys
from pathlib import Path

import pytest

from pftrack_sim.benchmark import run
from pftrack_sim.benchmark.reading.check import check
from pftrack_sim.core.errors import PftrackError
from pftrack_sim.report import write_report
from tests.attack.deadline import deadline
from tests.attack.test_fuzz import said
from tests.benchmark.small import small_plan

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="the deadline is that of Unix"),
]
FLIPS = int(os.environ.get("PFTRACK_SIM_FLIPS", "4"))
"""For each file."""


def test_no_flipped_bit_is_read_in_silence(tmp_path: Path):
    path = run(small_plan(range(2), ["oracle", "stay"]), tmp_path / "run", videos="first").path
    write_report(path)
    before = said(path)
    rng = random.Random(0)
    unseen: list[str] = []
    for file in sorted(one for one in path.rglob("*") if one.is_file() and one.stat().st_size):
        content = file.read_bytes()
        for place in rng.sample(range(8 * len(content)), FLIPS):
            changed = bytearray(content)
            changed[place // 8] ^= 1 << place % 8
            file.write_bytes(changed)
            name = f"{file.relative_to(path)}, bit {place}"
            with deadline():
                with contextlib.suppress(PftrackError):
                    unseen += [f"check: {name}"] if check(path).good else []
                with contextlib.suppress(PftrackError):
                    unseen += [f"readers: {name}"] if said(path) != before else []
        file.write_bytes(content)
    assert unseen == []
    assert check(path).good
    shutil.rmtree(path)
