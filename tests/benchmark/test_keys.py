"""A run is a set of results named by keys: it resumes, grows, merges, and knows what has become stale."""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

import pftrack_sim
from pftrack_sim.benchmark import Plan, RunStore, TrackerSpec, keys, make_plan, parse_seeds, run
from pftrack_sim.benchmark.asked.from_names import join_plans
from pftrack_sim.benchmark.asked.union import held_besides, united
from pftrack_sim.benchmark.reading.check import check
from pftrack_sim.benchmark.reading.merge import merge
from pftrack_sim.benchmark.running.filming import film, worst
from pftrack_sim.benchmark.running.progress import RunProgress
from pftrack_sim.core.code_digest import MAX_CODE_BYTES
from pftrack_sim.core.errors import ParameterError, RunError
from pftrack_sim.scenario import load
from tests.benchmark.small import SMALL, contents, settings
from tests.trackers.test_sandbox import sandbox_works

STILL = "tests.benchmark.faulty_trackers:good"


def plan_of(seeds: str, trackers: list[str], axes: dict[str, list[float]] | None = None, **more: Any) -> Plan:
    changes = {**SMALL, **more.pop("changes", {})}
    return make_plan(["corridor"], trackers, parse_seeds(seeds), axes=axes or {}, overrides=changes, **more)


def files(path: Path) -> dict[str, tuple[int, bytes]]:
    found = sorted((path / "episodes").rglob("*.parquet"))
    return {str(file.relative_to(path)): (file.stat().st_mtime_ns, file.read_bytes()) for file in found}


def test_a_key_is_the_same_whatever_else_is_asked_for_and_another_for_whatever_determines_the_result():
    plan = plan_of("0:2", ["stay", "oracle"])
    wider = plan_of("1,0,7", ["oracle", "ncc", "stay"], {"jitter": [0.0]})
    assert len(plan.asked) == 4
    assert not plan.asked.keys() & wider.asked.keys(), "another condition is another result"
    assert plan.asked.keys() < plan_of("1,0,7", ["oracle", "ncc", "stay"]).asked.keys()
    assert {one.frames_key for one in plan.episodes()} == {one.frames_key for one in plan_of("1,0", ["ncc"]).episodes()}
    others = [
        plan_of("0:2", ["stay", "oracle"], changes={"camera.height_m": 1.3}),
        plan.model_copy(update={"truth": "visible_box"}),
        plan.model_copy(update={"environment": {**plan.environment, "numpy": "0.1"}}),
        plan.model_copy(update={"trackers": tuple(one.model_copy(update={"code": {}}) for one in plan.trackers[:1])}),
        plan_of("0:2", ["stay", "oracle"], controllers=["still"]),
    ]
    for other in others:
        fresh = Plan.model_validate(other.model_dump())
        assert not fresh.asked.keys() & plan.asked.keys()


@pytest.mark.parametrize(("entry", "drawn_again"), [(keys.SIMULATOR, True), (keys.SCORING, False)])
def test_other_code_of_the_package_is_another_result_and_of_the_simulator_other_frames(entry: str, drawn_again: bool):
    plan = plan_of("0:2", ["stay"])
    other = Plan.model_validate(plan.model_dump() | {"environment": {**plan.environment, entry: "0"}})
    assert not other.asked.keys() & plan.asked.keys()
    frames, others = ({one.frames_key for one in each.episodes()} for each in (plan, other))
    assert bool(frames & others) is not drawn_again


def test_a_run_is_resumed_by_the_keys_that_are_missing(tmp_path: Path):
    out, plan = tmp_path / "run", plan_of("0:2", ["oracle", "stay"])
    whole, kept = contents(run(plan, out, videos="none").path), files(out)
    lost = sorted(kept)[1]
    (out / lost).unlink()
    half = (out / lost).with_name(f".{Path(lost).name}.0badcafe.part")
    half.write_bytes(kept[lost][1][:1000])
    seen: list[RunProgress] = []
    run(plan, out, videos="none", on_progress=seen.append)
    assert [status.done for status in seen if status.episode] == [2]
    again = files(out)
    assert [name for name in kept if again[name] != kept[name]] == [lost]
    assert contents(out) == whole
    assert not half.exists()
    run(plan, out, videos="none", on_progress=seen.append)
    assert seen[-1].frames == 0
    assert files(out) == again


@pytest.mark.slow
def test_a_run_grows_and_what_was_there_stays(tmp_path: Path):
    out, jitter = tmp_path / "run", {"jitter": [0.0]}
    run(plan_of("0", ["oracle"], jitter), out, videos="all")
    first = files(out)
    run(plan_of("0:2", ["oracle"], jitter), out, videos="none")
    second = files(out)
    assert second.items() >= first.items()
    run(plan_of("1", ["oracle"], {"jitter": [0.0, 1.0]}), out, videos="none")
    third = files(out)
    assert third.items() >= second.items()
    assert [len(one) for one in (first, second, third)] == [1, 2, 3]
    run(plan_of("0", ["stay"], jitter), out, videos="worst:1")
    assert files(out).items() >= third.items()
    counts = RunStore(out).query("SELECT tracker, count(*) FROM summary GROUP BY tracker ORDER BY tracker").rows
    assert counts == [("oracle", 3), ("stay", 3)]
    assert check(out).good, check(out).problems
    # Videos show all trackers of an episode: those of before are gone.
    videos = {file.relative_to(out / "videos").with_suffix("").as_posix() for file in (out / "videos").rglob("*.mp4")}
    assert videos
    assert videos <= {one.path for one in RunStore(out).plan.episodes()}
    at_once = run(united(plan_of("0:2", ["oracle"], jitter), RunStore(out).plan), tmp_path / "at-once", videos="none")
    everything = "SELECT * EXCLUDE (ms) FROM frames ORDER BY condition, seed, label, frame"
    assert str(at_once.query(everything)) == str(RunStore(out).query(everything))


def test_what_a_folder_holds_besides_is_named():
    stored = plan_of("0:8", ["stay", "ncc"], {"jitter": [0.0, 2.0]})
    assert held_besides(stored, stored) == ""
    assert held_besides(stored, plan_of("0:9", ["oracle", "ncc", "stay"], {"jitter": [2.0, 0.0, 1.0]})) == ""
    named = held_besides(stored, plan_of("2:4,9", ["ncc"], {"jitter": [0.0]}))
    assert named == "conditions jitter=2; trackers stay; seeds 0:2,4:8"


@pytest.mark.slow
def test_a_run_that_is_interrupted_while_it_grows_is_readable_and_goes_on(tmp_path: Path):
    out = tmp_path / "run"
    run(plan_of("0:2", ["oracle"]), out, videos="none")
    run(plan_of("0:2", ["stay"]), out, videos="none", part=(2, 2))
    assert check(out).problems == ("missing: corridor seed 1, stay",)
    assert not RunStore(out).finished
    assert [(one.seed, one.label) for one in RunStore(out).results] == [(0, "oracle"), (0, "stay"), (1, "oracle")]
    run(plan_of("0:2", ["stay"]), out, videos="none")
    assert check(out).good
    assert RunStore(out).finished


@pytest.mark.slow
def test_runs_of_other_seeds_and_trackers_are_merged_and_the_rest_is_asked_for(tmp_path: Path):
    run(plan_of("0:2", ["oracle"]), tmp_path / "one", videos="none")
    run(plan_of("1:3", ["oracle", "stay"]), tmp_path / "two", videos="none")
    report = merge(tmp_path / "both", [tmp_path / "one", tmp_path / "two"])
    assert (report.added, report.shared, report.done, report.total) == (5, 1, 5, 6)
    assert check(tmp_path / "both").problems == ("missing: corridor seed 0, stay",)
    assert files(tmp_path / "both").keys() == files(tmp_path / "one").keys() | files(tmp_path / "two").keys()
    other = run(plan_of("0", ["oracle"], changes={"duration_s": 0.5}), tmp_path / "other", videos="none")
    with pytest.raises(RunError, match=r"scenarios.corridor.duration_s: 0.4 there, 0.5 asked for"):
        merge(tmp_path / "all", [tmp_path / "one", other.path])
    assert not (tmp_path / "all").exists()


@pytest.fixture
def mine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A tracker of one's own with a helper module, in a folder on the path."""
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "tracker_of_mine.py").write_text("from helper_of_mine import Held as make\n")
    (folder / "helper_of_mine.py").write_text(
        "from pftrack_sim.core.records import Estimate\n"
        "class Held:\n"
        "    def __init__(self, seed, preset):\n        pass\n"
        "    def init(self, image, box):\n        self.box = box\n"
        "    def update(self, image):\n        return Estimate(self.box)\n"
    )
    monkeypatch.syspath_prepend(folder)
    return folder


@pytest.mark.parametrize("edited", ["tracker_of_mine.py", "helper_of_mine.py"])
def test_an_edited_tracker_or_helper_makes_its_results_stale_and_no_others(tmp_path: Path, mine: Path, edited: str):
    trackers, out = ["stay", "tracker_of_mine:make"], tmp_path / "run"
    run(plan_of("0:2", trackers), out, videos="none")
    before = files(out)
    (mine / edited).write_text((mine / edited).read_text() + "# edited\n")
    with pytest.raises(RunError, match=r"trackers\.tracker_of_mine:make\.code\..* there, .* asked for"):
        run(plan_of("0", trackers), out, videos="none")
    with pytest.raises(RunError, match="--refresh"):  # it would run in the new episode
        run(plan_of("2", ["stay"]), out, videos="none")
    assert files(out) == before
    run(plan_of("0", trackers), out, videos="none", refresh=True)
    after = files(out)
    assert {name: one for name, one in before.items() if "-stay-" in name}.items() <= after.items()
    assert len(after) == 4
    assert len(before.keys() & after.keys()) == 2
    assert check(out).good


READER = """
import importlib, json
from pathlib import Path
from numba import njit
from pftrack_sim.core.records import Estimate
from compiled_of_mine import width

HERE = Path(__file__).parent
Y = json.loads((HERE / "weights.json").read_text())

@njit(cache=True)
def grown(w):
    return w + width()

@njit(cache=True)
def y():
    return Y

class Reader:
    def init(self, image, box):
        self.by_name = importlib.import_module("by_" + "name")
    def update(self, image):
        x = json.loads((HERE / "late.json").read_text())
        return Estimate([x, y(), grown(5.0), self.by_name.height()])

def make(**_):
    return Reader()
"""
READ = {
    "reader_of_mine.py": READER,
    "compiled_of_mine.py": "from numba import njit\n@njit\ndef width():\n    return 1.0\n",
    "by_name.py": "from numba import njit\nfrom by_others import part\n@njit(cache=True)\n"
    "def height():\n    return part()\n",
    "by_others.py": "from numba import njit\n@njit\ndef part():\n    return 1.0\n",
    "weights.json": "1.0",
    "late.json": "1.0",
}
"""A tracker that reads files, loads a module under a computed name, and compiles what is in other files."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("isolation", "edited", "place", "value"),
    [
        ("auto", "compiled_of_mine.py", 2, 7.0),
        ("auto", "by_others.py", 3, 2.0),
        ("auto", "weights.json", 1, 2.0),
        ("container", "late.json", 0, 2.0),
    ],
)
def test_edits_of_what_a_tracker_opens_loads_and_compiles_are_seen(
    tmp_path: Path, mine: Path, isolation: str, edited: str, place: int, value: float
):
    if isolation == "container" and not sandbox_works():
        pytest.skip("needs bubblewrap")
    for name, text in READ.items():
        (mine / name).write_text(text)
    trackers, out = ["stay", "reader_of_mine:make"], tmp_path / "run"

    def answers(**options: Any) -> list[float]:
        done = run(plan_of("0", trackers), out, videos="first", isolation=isolation, **options)
        assert [one.error for one in done.results] == [None, None]
        assert check(out).good
        return done.frame_columns(done.results[1], ["estimate"])["estimate"][1].tolist()

    before = answers()
    assert before == [1.0, 1.0, 6.0, 1.0]
    kept = files(out)
    assert answers() == before
    assert files(out) == kept
    (mine / edited).write_text(READ[edited].replace("1.0", "2.0"))
    with pytest.raises(RunError, match=r"--refresh.*\n  trackers\.reader_of_mine:make\.\w+\..* there, .* asked for"):
        answers()
    assert files(out) == kept
    after = answers(refresh=True)
    assert after == [*before[:place], value, *before[place + 1 :]]
    assert {name for name, one in kept.items() if files(out).get(name) == one} == {n for n in kept if "-stay-" in n}


@pytest.mark.parametrize("name", ["link.json", "library.so"])
def test_a_link_that_leads_elsewhere_and_another_library_are_other_code(tmp_path: Path, mine: Path, name: str):
    library, file = Path(np.random.bit_generator.__file__).read_bytes(), mine / name
    opens = f"ctypes.CDLL({str(file)!r})" if name == "library.so" else f"open({str(file)!r}).close()"
    helper = mine / "helper_of_mine.py"
    helper.write_text("import ctypes\n" + helper.read_text().replace("pass", opens))
    for one in ("one", "two"):
        (mine / one).write_bytes(library + one.encode())
    file.symlink_to(mine / "one")
    plan = lambda: plan_of("0", ["tracker_of_mine:make"])  # noqa: E731
    run(plan(), tmp_path / "run", videos="none")
    file.unlink()
    file.symlink_to(mine / "two")
    with pytest.raises(RunError, match=rf"--refresh.*\n  trackers\.tracker_of_mine:make\.opened\.{name}: "):
        run(plan(), tmp_path / "run", videos="none")


def test_a_file_too_large_to_read_counts_by_its_size(tmp_path: Path, mine: Path):
    (mine / "helper_of_mine.py").write_text(
        (mine / "helper_of_mine.py").read_text().replace("pass", f"open({str(mine / 'large')!r}, 'rb').close()")
    )
    for size in (MAX_CODE_BYTES + 1, MAX_CODE_BYTES + 2):
        with open(mine / "large", "wb") as file:
            file.truncate(size)
        done = run(plan_of("0", ["tracker_of_mine:make"]), tmp_path / "run", videos="none", refresh=True)
        ((_, opened),) = done.opened()
        assert opened.pop("large") == f"{size} bytes"
        assert sorted(opened) == ["helper_of_mine.py", "tracker_of_mine.py"]


def test_a_folder_that_a_full_disk_left_without_a_record_is_begun_again(tmp_path: Path):
    for name, content in (("SHA256SUMS", ""), (".lock", "")):
        (tmp_path / name).write_text(content)
    (tmp_path / ".scratch").mkdir()
    assert len(run(plan_of("0", ["stay"]), tmp_path, videos="none").results) == 1
    (tmp_path / "run.json").unlink()
    with pytest.raises(RunError, match="not an empty folder"):
        run(plan_of("0", ["stay"]), tmp_path, videos="none")


def test_an_edited_scenario_is_refused_or_refreshed(tmp_path: Path):
    scenario, out = tmp_path / "mine.toml", tmp_path / "run"
    scenario.write_text(tomli_w.dumps(load("corridor", {**SMALL, "target.actions": []}).tree))
    plan = lambda seeds: make_plan([str(scenario)], ["stay"], seeds)  # noqa: E731
    run(plan([0, 1]), out, videos="first")
    scenario.write_text(scenario.read_text().replace("duration_s = 0.4", "duration_s = 0.5"))
    with pytest.raises(RunError, match=r"mine.toml\.duration_s: 0\.4 there, 0\.5 asked for"):
        run(plan([0]), out, videos="none")
    assert check(out).good
    refreshed = run(plan([0]), out, videos="none", refresh=True)
    assert [result.values["episode_frames"] for result in refreshed.results] == [5, 5]
    assert not list((out / "videos").rglob("*.mp4"))
    assert check(out).good


def test_an_edited_default_of_an_axis_in_the_package_is_said(tmp_path: Path):
    """The same command with another default of the gain: neither mixed nor silent."""
    root = Path(pftrack_sim.__file__).parents[1]
    out, package = tmp_path / "run", tmp_path / "edited/pftrack_sim"
    run(plan_of("0", ["stay"], {"noise": [1.0]}), out, videos="none")
    shutil.copytree(root / "pftrack_sim", package, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("envs", "assets"):
        (package.parent / name).symlink_to(root / name)
    axes = package / "scenario/axes.py"
    source = axes.read_text()
    assert source.count("gain: Positive = setting(7.5") == 1
    axes.write_text(source.replace("setting(7.5", "setting(30.0"))
    words = ["bench", "corridor", "--trackers", "stay", "--seeds", "0:2", "--axis", "noise=1", "--out", str(out)]
    done = subprocess.run(
        [sys.executable, "-m", "pftrack_sim", *words, "--workers", "0", *settings(SMALL)],
        env={**os.environ, "PYTHONPATH": str(package.parent)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2, done.stderr
    said = " ".join(done.stderr.split())
    assert "scenarios.corridor.axes.noise.gain: 7.5 there, 30.0 asked for" in said
    assert "run with.code of the simulator: " in said
    assert check(out).good


def test_one_folder_cannot_hold_open_and_closed_loop(tmp_path: Path):
    stored = plan_of("0:2", ["stay"])
    assert united(stored, plan_of("1", ["stay"])) is stored
    with pytest.raises(ParameterError, match="either every tracker needs a controller"):
        united(stored, plan_of("0", ["stay"], controllers=["still"]))


def test_blocks_of_a_suite_with_other_contents_of_one_scenario_are_united():
    def plan(seeds: list[int], variant: str, height_m: float) -> Plan:
        changes = {**SMALL, "camera.height_m": height_m}
        return make_plan(["corridor"], [TrackerSpec(name="stay")], seeds, overrides=changes, variant=variant)

    both = united(plan([0], "low", 1.0), plan([0, 1], "high", 1.4))
    heights = {(one.condition.name, one.seed): one.scenario.resolve(0).camera.height_m for one in both.episodes()}
    assert heights == {("low base", 0): 1.0, ("high base", 0): 1.4, ("high base", 1): 1.4}


def test_a_suite_whose_settings_are_not_the_stored_ones_keeps_no_stored_result():
    def plan(axis: str, height_m: float) -> Plan:
        return plan_of("0", ["stay"], {axis: [1.0]}, changes={"camera.height_m": height_m})

    stored, suite = plan("light", 1.0), join_plans([plan("jitter", 1.2), plan("noise", 1.4)])
    assert not united(stored, suite).asked.keys() & stored.asked.keys()
    assert united(suite, plan("light", 1.4)).asked.keys() > suite.asked.keys()
    assert not united(suite, stored).asked.keys() & suite.asked.keys()


@pytest.mark.slow
@pytest.mark.parametrize("controllers", [[], ["servo"]], ids=["open", "follow"])
def test_the_worst_episodes_are_filmed_from_what_is_stored(tmp_path: Path, controllers: list[str]):
    out = tmp_path / "run"
    latency = {"latency_ms": {STILL: 30.0}} if controllers else {}
    plan = plan_of("0:3", [STILL], controllers=controllers, changes={"duration_s": 0.8}, **latency)
    run(plan, out, videos="none", isolation="never")
    store = RunStore(out)
    (lowest,) = worst(store.results, 1, tracker=STILL)
    assert lowest.number("mean_overlap") == min(one.number("mean_overlap") for one in store.results)
    with RunStore.begin(out, plan) as writing:
        (video,) = film(writing, [lowest])
        writing.write_summary()
    assert video == RunStore(out).video_of(lowest)
    assert video.stat().st_size > 1000
    assert check(out).good
    with pytest.raises(ParameterError, match=">= 1"):
        worst(store.results, 0)


@pytest.mark.slow
@pytest.mark.parametrize("controllers", [[], ["servo"]], ids=["open", "follow"])
def test_a_film_of_other_frames_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, controllers: list[str]):
    plan = plan_of("0:1", [STILL], controllers=controllers)
    run(plan, tmp_path, videos="none", isolation="never")
    with RunStore.begin(tmp_path, plan) as writing:
        columns = RunStore.frame_columns
        with monkeypatch.context() as changed:
            changed.setattr("pftrack_sim.benchmark.running.filming.TruthLog.frames_digest", property(lambda _: "other"))
            with pytest.raises(RunError, match="are not those that the trackers saw"):
                film(writing, writing.results)
        # One frame fewer is stored than is drawn.
        shortened = lambda *given: {name: column[:-1] for name, column in columns(*given).items()}  # noqa: E731
        monkeypatch.setattr(RunStore, "frame_columns", shortened)
        with pytest.raises(RunError, match="are not those that the trackers saw"):
            film(writing, writing.results)
    assert not list(tmp_path.rglob("*.mp4"))
