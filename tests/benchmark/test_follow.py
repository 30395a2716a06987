"""Closed-loop runs: the plan, the folder and the workers of the benchmark, with the tracker driving the robot."""

from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pftrack_sim.benchmark import Plan, RunStore, TrackerSpec, make_plan, plan_all, run
from pftrack_sim.benchmark.reading.check import check
from pftrack_sim.benchmark.running.latency import measure_ms, resolve_latencies
from pftrack_sim.core.errors import ParameterError, RunError
from pftrack_sim.core.proprioception import PROPRIO_INDEX, RANGES
from pftrack_sim.env import TrackAndFollowEnv
from pftrack_sim.scenario import load
from tests.benchmark.small import SMALL, contents

THIS = "tests.benchmark.test_follow"


class Raises:
    """Fails after two frames."""

    command = (0.5, 0.5, 0.5, 0.5)

    def __init__(self) -> None:
        self.frames = 0

    def reset(self, rig) -> None:
        pass

    def act(self, estimate, proprio):
        self.frames += 1
        if type(self) is Raises and self.frames > 2:
            raise RuntimeError("the motor is on fire")
        return np.array(self.command)


class Unsure(Raises):
    command = (np.nan,) * 4


class Greedy(Raises):
    command = (0.0, 7.0, 0.0, 0.0)


def driving(seeds: range = range(2), trackers: tuple[Any, ...] = ("oracle", "stay"), **more: Any) -> Plan:
    overrides = {**SMALL, **more.pop("overrides", {})}
    options = {"controllers": ["servo-avoid"], **more}
    return make_plan(["corridor"], trackers, list(seeds), overrides=overrides, **options)


@pytest.fixture(scope="module")
def one(tmp_path_factory: pytest.TempPathFactory) -> RunStore:
    return run(driving(latency_ms={"stay": 130.0}), tmp_path_factory.mktemp("follow") / "run", videos="first")


def frames(path: Path, columns: str, tracker: str) -> np.ndarray:
    sql = f"SELECT {columns} FROM frames WHERE tracker LIKE '{tracker}%' AND seed = 0 ORDER BY frame"
    return np.array(RunStore(path).query(sql).rows, dtype=np.float64)


def test_a_run_folder_is_complete(one: RunStore):
    assert check(one.path).good
    labels = ["oracle-servo-avoid", "stay-130ms-servo-avoid"]
    assert [Path(file).stem.rpartition("-")[0] for file, *_ in contents(one.path)] == [
        f"seed-000{seed}-{label}" for seed in (0, 1) for label in labels
    ]
    identity = "tracker, label, controller, latency_ms"
    sql = f"SELECT {identity}, outcome, mean_overlap FROM summary WHERE seed = 0 ORDER BY place"
    first, second = one.query(sql).rows
    assert first == ("oracle", "oracle+servo-avoid", "servo-avoid", 0.0, "finished", 1.0)
    assert second[:5] == ("stay", "stay@130ms+servo-avoid", "servo-avoid", 130.0, "finished")
    assert len(list((one.path / "videos").rglob("*.mp4"))) == 2
    followed = [result.following for result in one.results]
    assert all(following is not None and following.length == 4 for following in followed)


def test_the_pose_after_a_command_is_that_of_the_next_frame(one: RunStore):
    here, then = frames(one.path, "robot_x_m, robot_y_m", "oracle"), frames(one.path, "after_x_m, after_y_m", "oracle")
    assert np.array_equal(here[1:], then[:-1])
    gaps = frames(one.path, "robot_x_m - target_x_m, robot_y_m - target_y_m", "oracle")
    distances = frames(one.path, "after_distance_m", "oracle")[:, 0]
    # The camera is not quite above the axle.
    assert np.abs(np.hypot(*gaps.T)[1:] - distances[:-1]).max() < 0.15


def test_sensors_and_people_of_every_drive_are_stored(one: RunStore):
    with closing(TrackAndFollowEnv(one.plan.episode(0).scenario)) as env:
        observation, _ = env.reset(seed=0)
    heading, ranges = one.query(
        "SELECT odometry_heading_rad, ranges_m FROM frames WHERE tracker = 'oracle' AND seed = 0 AND frame = 0"
    ).rows[0]
    assert heading == observation["proprio"][PROPRIO_INDEX["odometry_heading_rad"]]
    assert np.array_equal(ranges, observation["proprio"][RANGES])
    # Odometry counts from the start, and here its calibration is exact: what is left is slip.
    driven = frames(one.path, "odometry_x_m", "oracle")[-1, 0]
    start, end = frames(one.path, "robot_x_m, robot_y_m", "oracle")[[0, -1]]
    assert driven == pytest.approx(np.hypot(*(end - start)), abs=0.05)
    people = one.query(
        "SELECT label, seed, count(*) FROM people WHERE person = 'target' GROUP BY ALL ORDER BY ALL"
    ).rows
    labels = sorted({result.label for result in one.results})
    assert people == [(label, seed, 4) for label in labels for seed in (0, 1)]


@pytest.mark.slow
def test_without_images_the_robot_drives_the_same_way(one: RunStore, tmp_path: Path):
    bare = run(driving(range(1), ("oracle",)), tmp_path / "bare", backend="none")
    drive = "after_x_m, after_y_m, after_distance_m, visible_fraction, target_x_m"
    assert np.abs(frames(bare.path, drive, "oracle") - frames(one.path, drive, "oracle")).max() < 1e-6
    assert not list(bare.path.rglob("*.mp4"))
    with pytest.raises(ParameterError, match=r"'stay.*' needs images"):
        run(driving(), tmp_path / "refused", backend="none")
    with pytest.raises(ParameterError, match="videos and logs need images"):
        run(driving(trackers=("oracle",)), tmp_path / "refused", backend="none", videos="all")
    with pytest.raises(ParameterError, match="only closed-loop runs"):
        run(make_plan(["corridor"], ["oracle"], [0]), tmp_path / "refused", backend="none")
    assert not (tmp_path / "refused").exists()


@pytest.mark.slow
def test_two_workers_and_another_order_give_the_same_bits(one: RunStore, tmp_path: Path):
    two = run(one.plan, tmp_path / "two", workers=2, videos="none", shuffle=1)
    assert contents(two.path) == contents(one.path)


@pytest.mark.slow
def test_a_busy_tracker_skips_frames_and_the_latency_axis_replaces_its_latency(one: RunStore, tmp_path: Path):
    plan = driving(range(1), ("oracle",), axes={"latency": [0.0, 130.0]}, latency_ms={"oracle": 500.0})
    late = run(plan, tmp_path / "late", videos="none")
    rows = late.query("SELECT condition, latency_ms FROM summary ORDER BY number").rows
    assert rows == [("latency=0", 0.0), ("latency=130", 130.0)]
    statuses = late.query("SELECT condition, status FROM frames ORDER BY condition, frame").rows
    assert [status for condition, status in statuses if condition == "latency=0"] == ["init", "ok", "ok", "ok"]
    assert [status for condition, status in statuses if condition == "latency=130"] == ["init", "busy", "ok", "busy"]
    fresh = late.query("SELECT frames_digest FROM summary WHERE latency_ms = 0").rows
    assert fresh == one.query("SELECT frames_digest FROM summary WHERE seed = 0 AND place = 0").rows


@pytest.mark.parametrize(
    ("controller", "says", "clipped"),
    [
        pytest.param("Raises", "frame 2: RuntimeError: the motor is on fire", 0, marks=pytest.mark.slow),
        ("Unsure", "frame 0: CommandError: a command must be finite", 0),
        pytest.param("Greedy", None, 4, marks=pytest.mark.slow),
    ],
)
def test_the_failure_of_a_controller_is_recorded(controller: str, says: str | None, clipped: int, tmp_path: Path):
    wrong = run(driving(range(1), ("oracle",), controllers=[f"{THIS}:{controller}"]), tmp_path / "run", videos="none")
    ((failure, counted, outcome),) = wrong.query("SELECT error, clipped, outcome FROM summary").rows
    assert counted == clipped
    assert outcome in ("finished", "lost")
    assert failure is None if says is None else failure.startswith(says)
    commands = frames(wrong.path, "command_forward, command_turn, command_pan, command_tilt", "oracle")
    assert np.abs(commands).max() <= 1.0
    if says is not None:
        assert not commands[2:].any()
    assert check(wrong.path).good


def test_a_tracker_that_fails_stops_the_robot(tmp_path: Path):
    plan = driving(range(1), ("tests.benchmark.faulty_trackers:raises",))
    failed = run(plan, tmp_path / "run", videos="none")
    ((failure, frames_there),) = failed.query("SELECT error, episode_frames FROM summary").rows
    assert failure.startswith("frame 2: ValueError: lost my way (faulty_trackers.py, line ")
    assert frames_there == 4
    assert not frames(failed.path, "command_forward, command_turn", "tests")[2:].any()


def test_defaults_of_closed_loop_plans():
    assert plan_all(["corridor"], closed_loop=True).labels == ("oracle+servo-avoid",)
    assert plan_all(["quick"], closed_loop=True).labels == tuple(
        f"{name}+servo-avoid" for name in ("ko2012", "opencv-mil", "stay")
    )
    assert plan_all(["quick"]).kind == "open"


def test_a_measured_latency_is_measured_once(tmp_path: Path):
    scenario = load("corridor", {**SMALL, "duration_s": 1.0})
    trackers = driving(range(1), ("stay", "ko2012")).trackers
    found = resolve_latencies({"stay": None, "ko2012": 13.0}, trackers, scenario)
    assert found["ko2012"] == 13.0
    assert 0.0 < found["stay"] < 1000.0
    begun = run(driving(range(1), ("stay",), latency_ms={"stay": 41.5}), tmp_path / "run", videos="none")
    assert resolve_latencies({"stay": None}, trackers, scenario, begun.path) == {"stay": 41.5}


def test_two_parameterisations_of_a_tracker_have_latencies_of_their_own():
    few, many = (TrackerSpec(name="ko2012", params={"particle_count": count}) for count in (10, 50))
    plan = driving(range(1), (few, many), latency_ms={"ko2012": 40.0, "ko2012[particle_count=10]": 7.0})
    assert [spec.latency_ms for spec in plan.trackers] == [7.0, 40.0]
    scenario = load("corridor", {**SMALL, "duration_s": 0.3})
    given = {"ko2012": 40.0, "ko2012[particle_count=10]": 7.0}
    assert resolve_latencies(given, (few, many), scenario) == {few.base_label: 7.0, many.base_label: 40.0}


def test_a_tracker_that_follows_detections_is_measured_with_those_of_the_scenario():
    assert measure_ms(TrackerSpec(name="chau2011"), load("corridor", {**SMALL, "duration_s": 0.5})) > 0.0


def test_a_third_party_tracker_is_measured_in_a_process_of_its_own():
    """It leaves the process with `os._exit`: in this process nothing would be left to report."""
    scenario = load("corridor", {**SMALL, "duration_s": 0.5})
    with pytest.raises(RunError, match=r"cannot measure the latency .* exit code 3"):
        measure_ms(TrackerSpec(name="tests.benchmark.faulty_trackers:calls_os_exit"), scenario)
