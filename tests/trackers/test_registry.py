"""Trackers by name, and errors for wrong names and parameters."""

from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pftrack_sim
from pftrack_sim import trackers
from pftrack_sim.core import plugins
from pftrack_sim.core.errors import ParameterError, TrackerError, UnknownNameError
from pftrack_sim.core.records import Estimate
from pftrack_sim.trackers import registry
from tests.fresh_process import printed


class Mine:
    """A third-party tracker."""

    def __init__(self, **given: Any) -> None:
        self.given = given

    def init(self, image: np.ndarray, box: np.ndarray) -> None:
        self.box = box

    def update(self, image: np.ndarray) -> Estimate:
        return Estimate(self.box)


def mine(*, seed: int, preset: str, speed: float = 1.0) -> Mine:
    if preset not in trackers.PRESETS:
        raise ParameterError("mine: no such preset")
    return Mine(seed=seed, preset=preset, speed=speed)


def breaks(**_: Any) -> Mine:
    raise RuntimeError("no licence")


def makes_a_string(**_: Any) -> str:
    return "tracker"


def no_seed(preset: str) -> Mine:
    return Mine(preset=preset)


NUMBER = 5


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch):
    def announce(**values: str) -> None:
        points = [EntryPoint(name, value, registry.GROUP) for name, value in values.items()]

        def found(group: str) -> list[EntryPoint]:
            assert group == registry.GROUP
            return points

        monkeypatch.setattr(plugins, "entry_points", found)

    return announce


def test_names_are_sorted_and_described():
    assert trackers.names() == sorted(trackers.names())
    assert {"ko2012", "opencv-mil", "oracle", "stay"} <= set(trackers.names())
    assert all(trackers.describe(name) and "\n" not in trackers.describe(name) for name in trackers.names())


@pytest.mark.parametrize("ask", [trackers.make, trackers.describe])
def test_unknown_names_report_the_nearest(ask: Any):
    with pytest.raises(UnknownNameError, match=r"unknown tracker 'ko2021'; did you mean 'ko2012'\? \(known: .*stay"):
        ask("ko2021")


@pytest.mark.parametrize("name", ["ko2012", "opencv-mil", "oracle", "stay"])
def test_an_unknown_preset_or_parameter_is_refused(name: str):
    with pytest.raises(
        ParameterError, match=r"unknown preset 'papr'; did you mean 'paper'\? \(known: default, paper\)"
    ):
        trackers.make(name, preset="papr")
    with pytest.raises(ParameterError, match="particle_cont: unknown key"):
        trackers.make(name, particle_cont=3)


def test_a_factory_itself_is_refused():
    with pytest.raises(ParameterError, match=r"given by its name or as 'package\.module:factory', got <function"):
        trackers.make(lambda **_: None)  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", [-1, 1.5, "one", None])
def test_invalid_seeds_are_refused(seed: Any):
    with pytest.raises(ParameterError, match="seed must be a whole number >= 0"):
        trackers.make("stay", seed=seed)


def test_numpy_integers_are_seeds():
    trackers.make("ko2012", seed=np.int64(3))  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"particle_count": 0}, "particle_count: got 0: input should be greater than or equal to 1"),
        ({"particle_count": 2.5}, "got 2.5: input should be a valid integer"),
        ({"particle_count": True}, "got True: input should not be a boolean"),
        ({"alpha": 1.01}, "alpha: got 1.01: input should be less than or equal to 1"),
        ({"alpha": float("nan")}, "alpha: got nan"),
        ({"sigma_centre": float("inf")}, "sigma_centre: got inf"),
        ({"alpha": "much"}, "alpha: got 'much': input should be a valid number"),
        (
            {"likelihood": "exponetial"},
            r"likelihood: got 'exponetial'; did you mean 'exponential'\? \(allowed: linear, exponential\)",
        ),
        ({"likelihood": ["linear"]}, "allowed: linear, exponential"),
        ({"particles": 1}, "particles: got 1: input should be True or False"),
        (
            {"aplha": 0.3},
            r"aplha: unknown key \(value 0.3\); did you mean 'alpha'\? \(allowed: alpha, camera_motion, held_noise",
        ),
        ({"module": 1}, "module: unknown key"),
        ({"aplha": 0.3, "alpha": 2}, "alpha: got 2: .*; aplha: unknown key"),
    ],
)
def test_a_parameter_out_of_range_is_refused(given: dict[str, Any], words: str):
    with pytest.raises(ParameterError, match=words) as caught:
        trackers.make("ko2012", **given)
    assert str(caught.value).startswith("ko2012: ")


def test_an_installed_tracker_is_found_by_name(installed: Any):
    installed(theirs=f"{__name__}:mine", stay=f"{__name__}:breaks")
    assert "theirs" in trackers.names()
    assert "mine" in trackers.describe("theirs")
    made = trackers.make("theirs", seed=4, preset="paper", speed=2.0)
    assert isinstance(made, Mine)
    assert made.given == {"seed": 4, "preset": "paper", "speed": 2.0}
    assert not isinstance(trackers.make("stay"), Mine), "a name of ours cannot be taken"


def test_a_factory_is_found_by_its_path():
    made = trackers.make(f"{__name__}:mine", seed=1)
    assert isinstance(made, Mine)
    assert made.given == {"seed": 1, "preset": "default", "speed": 1.0}
    with pytest.raises(ParameterError, match="no such preset"):
        trackers.make(f"{__name__}:mine", preset="other")


@pytest.mark.parametrize(
    ("spelled", "words"),
    [
        ("no_such_package_here:make", "ModuleNotFoundError"),
        (f"{__name__}:mien", "has no 'mien'; did you mean 'mine'"),
        (f"{__name__}:NUMBER", "cannot be called"),
        (f"{__name__}:", "package.module:factory"),
        (":mine", "package.module:factory"),
        (f"{__name__}:breaks", "RuntimeError: no licence"),
        (f"{__name__}:makes_a_string", "must make an object with init and update, got str"),
        (f"{__name__}:no_seed", "unexpected keyword argument 'seed'"),
    ],
)
def test_a_failing_factory_is_named(spelled: str, words: str, installed: Any):
    with pytest.raises(TrackerError, match=words) as caught:
        trackers.make(spelled)
    assert repr(spelled) in str(caught.value)
    installed(theirs=spelled)
    with pytest.raises(TrackerError, match="'theirs'"):
        trackers.make("theirs")
    assert "theirs" in trackers.names(), "a broken one must not hide the others"


def test_a_file_in_place_of_a_factory_says_how_it_is_spelled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "my_tracker.py").write_text("def make(*, seed, preset):\n    return torch.Tracker()\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    for spelled in ("my_tracker", "my_tracker.py"):
        with pytest.raises(TrackerError, match="expected module:factory, for example my_tracker:make"):
            trackers.make(spelled)
    with pytest.raises(TrackerError, match="did you mean 'my_tracker:make'"):
        trackers.make("my_tracker.py:make")
    with pytest.raises(TrackerError, match=r"'torch' is not defined.* \(my_tracker.py, line 2, in make\)"):
        trackers.make("my_tracker:make")


def test_unknown_parameters_of_a_third_party_factory_are_refused():
    with pytest.raises(ParameterError, match=r"has no parameter 'sped'; did you mean 'speed'\? \(allowed: speed\)"):
        trackers.make(f"{__name__}:mine", sped=2)


def test_importing_trackers_loads_neither_numba_nor_opencv():
    # Without the package's own __init__, which registers the environments and so loads more.
    code = """
import sys, types
sys.modules["pftrack_sim"] = package = types.ModuleType("pftrack_sim")
package.__path__ = [sys.argv[1]]
from pftrack_sim import trackers
from pftrack_sim.core import plugins
trackers.names(), trackers.make("stay"), trackers.make("oracle")
print({"numba", "cv2", "mujoco", "gymnasium"} & {*sys.modules})
"""
    assert printed(code, pftrack_sim.__path__[0]).strip() == "set()"
