"""Mutated scenarios, overrides, run folders and recorded sequences: one clear error or the same result.

`PFTRACK_SIM_FUZZ_CASES` sets the number of cases: 500 here, 10,000 in `make fuzz`.
"""

import json
import os
import shutil
import sys
import tomllib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pftrack_sim import scenario as scenarios
from pftrack_sim.benchmark import RunStore, run
from pftrack_sim.benchmark.reading.check import check
from pftrack_sim.cli.values import parse_axes, parse_settings, parse_trackers
from pftrack_sim.core.data_files import envs_dir
from pftrack_sim.core.errors import PftrackError
from pftrack_sim.formats import read_sequence
from pftrack_sim.report import write_report
from tests.attack.deadline import deadline
from tests.attack.mutations import VALUES, mutate_folder, mutated, mutated_bytes, paths
from tests.benchmark.small import contents, small_plan, with_sums

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="the deadline and the special files are those of Unix"),
]

CASES = int(os.environ.get("PFTRACK_SIM_FUZZ_CASES", "500"))
PLAN = small_plan(range(2), ["oracle", "stay"])
NAMES = ("plaza-walk", "warehouse", "lee2012/01", "follow/corridor")
TEXTS = {name: (envs_dir() / f"{name}.toml").read_bytes() for name in NAMES}
TREES = {name: tomllib.loads(text.decode()) for name, text in TEXTS.items()}


def cases(share: float) -> Any:
    return settings(
        max_examples=max(1, round(share * CASES)),
        deadline=None,
        derandomize=CASES <= 500,
        suppress_health_check=list(HealthCheck),
        database=None,
    )


def copied(folder: Path, copy: Path) -> Path:
    """A fresh copy, in the place of the former one."""
    shutil.rmtree(copy, ignore_errors=True)
    return Path(shutil.copytree(folder, copy))


def one_error(error: PftrackError) -> None:
    text = str(error)
    assert 0 < len(text) < 50_000
    text.encode()


@cases(0.3)
@given(st.sampled_from(NAMES), st.data())
def test_trees_of_scenarios(name: str, data: Any):
    tree = mutated(TREES[name], data)
    with deadline():
        try:
            loaded = scenarios.load(tree)
            loaded.frame_count(0)
        except PftrackError as error:
            one_error(error)


@cases(0.2)
@given(name=st.sampled_from(NAMES), data=st.data())
def test_files_of_scenarios(tmp_path_factory: pytest.TempPathFactory, name: str, data: Any):
    path = tmp_path_factory.getbasetemp() / "scenario.toml"
    path.write_bytes(mutated_bytes(TEXTS[name], data))
    with deadline():
        try:
            scenarios.load(path).frame_count(0)
        except PftrackError as error:
            one_error(error)


KEYS = sorted({".".join(map(str, path)) for tree in TREES.values() for path in paths(tree) if path})


@cases(0.2)
@given(
    st.sampled_from(NAMES),
    st.dictionaries(st.sampled_from(KEYS) | st.text(max_size=30), VALUES, min_size=1, max_size=3),
    st.text(max_size=60),
)
def test_overrides_and_words_of_the_command_line(name: str, overrides: dict[str, Any], word: str):
    with deadline():
        for read in (
            lambda: scenarios.load(name, overrides).frame_count(0),
            lambda: scenarios.load(name, parse_settings([f"{key}={word}" for key in overrides])).frame_count(0),
            lambda: scenarios.load(word),
            lambda: parse_trackers(word, "default"),
            lambda: parse_axes([f"jitter={word}"]),
        ):
            try:
                read()
            except PftrackError as error:
                one_error(error)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run(PLAN, tmp_path_factory.mktemp("fuzz") / "run", videos="first").path


def said(path: Path) -> str:
    """Everything that readers take from a run folder."""
    store = RunStore(path)
    columns = ("label", "frame", "overlap", "estimate", "box", "scored")
    one_each = {one.file: one for one in store.results}.values()
    read = [store.frame_columns(one, columns) for one in one_each]
    frames = [[table[name].tolist() for name in columns] for table in read]
    rows = store.query("FROM summary ORDER BY number, place").rows
    return str((frames, rows, [str(one.values["mean_overlap"]) for one in store.results]))


@cases(0.15)
@given(data=st.data())
def test_run_folders(finished: Path, tmp_path_factory: pytest.TempPathFactory, data: Any):
    path = copied(finished, tmp_path_factory.getbasetemp() / "changed")
    before = said(finished)
    name = mutate_folder(path, data)
    with deadline(120.0):
        try:
            complaints = not check(path).good
        except PftrackError as error:
            one_error(error)
            complaints = True
        try:
            silent = said(path) == before
        except PftrackError as error:
            one_error(error)
            silent = True
    assert silent or complaints, name


@cases(0.1)
@given(changes=st.integers(1, 3), data=st.data())
def test_what_is_done_with_changed_run_folders(
    finished: Path, tmp_path_factory: pytest.TempPathFactory, changes: int, data: Any
):
    """Each command works or says one error, and none harms a result that is good; a run that ends is as it was."""
    path = copied(finished, tmp_path_factory.getbasetemp() / "resumed")
    changed = {mutate_folder(path, data) for _ in range(changes)}
    store = RunStore(finished)
    good = [name for one in store.plan.asked.values() if not changed & {*(own := one.tables)} for name in own]
    ended = False
    with deadline(240.0):
        for what in (
            lambda: write_report(path),
            lambda: RunStore(path).query("SELECT tracker, mean_overlap FROM summary"),
            lambda: said(run(PLAN, path, videos="none").path),
        ):
            ended = False
            try:
                what()
                ended = True
            except PftrackError as error:
                one_error(error)
    # A result that the list of checksums does not name any more is run again.
    if "SHA256SUMS" not in changed:
        assert all((path / name).read_bytes() == (finished / name).read_bytes() for name in good), changed
    if ended:
        assert contents(path) == contents(finished), changed


@cases(0.1)
@given(data=st.data())
def test_records_of_runs(finished: Path, tmp_path_factory: pytest.TempPathFactory, data: Any):
    """`run.json` as a tree."""
    record = json.loads((finished / "run.json").read_text())
    changed = mutated(record, data)
    path = copied(finished, tmp_path_factory.getbasetemp() / "record")
    with_sums(path, finished=False)  # nothing vouches for the record
    with deadline():
        try:
            (path / "run.json").write_text(json.dumps(changed))
        except (TypeError, ValueError, RecursionError):
            return  # no JSON can hold this
        for read in (check, said):
            try:
                read(path)
            except PftrackError as error:
                one_error(error)


@pytest.fixture(scope="module")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sequence") / "square"
    (folder / "img").mkdir(parents=True)
    rng = np.random.default_rng(0)
    for index in range(4):
        cv2.imwrite(str(folder / f"img/{index + 1:04d}.png"), rng.integers(0, 255, (24, 32, 3), dtype=np.uint8))
    (folder / "groundtruth_rect.txt").write_text("3,4,8,9\nNaN,NaN,NaN,NaN\n5 6 8 9\n6\t6\t8\t9\n")
    return folder


@cases(0.05)
@given(data=st.data())
def test_recorded_sequences(sequence: Path, tmp_path_factory: pytest.TempPathFactory, data: Any):
    path = copied(sequence, tmp_path_factory.getbasetemp() / "sequence-changed")
    mutate_folder(path, data)
    with deadline():
        try:
            read = read_sequence(path)
            assert all(read.image(index).dtype == np.uint8 for index in range(len(read)))
        except PftrackError as error:
            one_error(error)
