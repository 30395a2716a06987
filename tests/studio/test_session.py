"""Laws of a session, without a browser."""

import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import av
import gymnasium as gym
import numpy as np
import pytest
import tomli_w

import pftrack_sim
from pftrack_sim import scenario as scenarios
from pftrack_sim.benchmark.asked.plan import TrackerSpec
from pftrack_sim.core import boxes
from pftrack_sim.core.errors import BoxError, ParameterError, ScenarioError, StudioError, UnknownNameError
from pftrack_sim.env import TrackEnv
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.studio import Session, Settings, Studio
from pftrack_sim.studio.settings import settings_of

SMALL = {"camera.width_px": 96, "camera.height_px": 72, "lights.shadows": False, "duration_s": 6.0}
PLAIN = Settings("easy/corridor", 1, SMALL, (TrackerSpec(name="stay"), TrackerSpec(name="oracle")))


@pytest.fixture
def session():
    one = Session(PLAIN)
    yield one
    one.close()


def test_frames_are_those_of_the_simulation_and_trackers_see_them(session: Session):
    with Simulation(PLAIN.scenario()) as simulation:
        assert np.array_equal(simulation.reset(1).image, session.moment.frame.image)
        for _ in range(3):
            assert np.array_equal(simulation.advance().image, session.advance().frame.image)
    assert session.moment.overlaps["oracle"] == 1.0
    assert 0.0 < session.moment.overlaps["stay"] <= 1.0
    assert [one.frame.index for one in session.history] == [0, 1, 2, 3]
    assert session.errors == []


def test_the_saved_file_reproduces_the_frames_after_a_restart_with_changed_axes(session: Session, tmp_path: Path):
    session.advance()
    said = session.change(session.settings.with_axis("noise", 10.0).with_axis("jitter", 2.0))
    assert said == "Applied from 0.03 s on."
    assert not session.exact, "the suspension remembers another road"
    session.advance()
    said = session.change(session.settings.with_axis("light", 1.0))
    assert said.startswith("Restarted with these settings at 0.07 s")
    assert session.exact
    shown = [session.moment, session.advance()]
    saved = tmp_path / "saved.toml"
    saved.write_text(session.settings.toml())
    with Simulation(scenarios.load(str(saved))) as simulation:
        frames = [simulation.reset(1), *(simulation.advance() for _ in range(3))]
    for moment in shown:
        assert np.array_equal(frames[moment.frame.index].image, moment.frame.image)
        assert frames[moment.frame.index].truth == moment.frame.truth


def test_scrubbing_back_and_restarting_there_repeats_the_episode(session: Session):
    session.change(replace(session.settings, driver="hand"))
    for turn in (0.0, 0.5, -0.5, 1.0):
        session.hand = np.array([0.3, turn, 0.2, 0.0])
        session.advance()
    then = session.history[2]
    last = session.moment
    session.restart(then)
    assert np.array_equal(session.moment.frame.image, then.frame.image)
    for turn in (-0.5, 1.0):
        session.hand = np.array([0.3, turn, 0.2, 0.0])
        session.advance()
    assert np.array_equal(session.moment.frame.image, last.frame.image)
    assert not session.exact


def test_a_controller_drives_with_the_boxes_of_the_first_tracker(session: Session):
    session.change(replace(PLAIN, trackers=(TrackerSpec(name="oracle"),), driver="servo"))
    start = session.simulation.world.robot_pose()
    for _ in range(12):
        session.advance()
    assert session.simulation.world.robot_pose() != start
    assert session.simulation.command is not None


def test_another_person_is_tracked_after_a_selection(session: Session):
    for _ in range(40):
        other = [one for one in session.moment.frame.people[1:] if one.scored]
        if other:
            break
        session.advance()
    x, y, width, height = other[0].box
    centre = (x + 0.5 * width, y + 0.5 * height)
    assert session.person_at(session.moment, *centre) in [one.name for one in session.moment.frame.people]
    assert session.person_at(session.moment, -5.0, -5.0) is None
    session.select(other[0].name)
    assert session.moment.truth.name == other[0].name
    assert session.moment.overlaps["oracle"] == 1.0
    assert session.moment.frame.truth.name == "target", "the simulation knows nothing of it"
    with pytest.raises(UnknownNameError, match="unknown person"):
        session.select("nobody")


def test_a_drawn_box_starts_the_trackers_and_names_who_is_in_it(session: Session):
    for _ in range(3):
        session.advance()
    x, y, width, height = session.moment.truth.box
    drawn = np.array([x + 1.0, y - 2.0, width, height])
    said = session.select_box(drawn)
    assert "overlap is with target" in said
    expected = boxes.clip(drawn, 96, 72)
    assert np.array_equal(session.moment.estimates["stay"].box, expected)
    assert session.moment.frame.index == 3
    session.advance()
    assert np.array_equal(session.moment.estimates["stay"].box, expected), "stay keeps the drawn box"
    session.select_box([-10.0, 60.0, 40.0, 40.0])
    assert np.array_equal(session.moment.estimates["stay"].box, [0.0, 60.0, 30.0, 12.0]), "cut at the image"
    assert session.person == "target", "nobody is there"
    before = session.moment
    with pytest.raises(BoxError, match="4 px inside the image"):
        session.select_box([95.0, 0.0, 40.0, 40.0])
    assert session.moment is before


def test_an_environment_gives_the_settings_of_a_studio():
    overrides = {**SMALL, "occluders": [], "axes.jitter.severity": 0.5}
    env = gym.make("pftrack_sim/Track-v0", scenario="easy/corridor", overrides=overrides)
    base = env.unwrapped
    assert isinstance(base, TrackEnv)
    settings = settings_of(base.scenario, 3)
    assert settings.scenario().tree == base.scenario.tree
    assert settings.name == "easy/corridor"
    assert settings.overrides["axes.jitter.severity"] == 0.5
    assert [key for key in settings.overrides if key not in overrides] == []
    env.close()
    tree = scenarios.load("easy/corridor").tree
    with pytest.raises(ParameterError, match="tomli_w"):
        settings_of(scenarios.load(dict(tree)), 3)
    with pytest.raises(ParameterError, match="got CartPoleEnv"):
        pftrack_sim.studio(gym.make("CartPole-v1"))


def test_an_episode_goes_on_when_fewer_frames_are_delivered_from_now_on():
    session = Session(replace(PLAIN, overrides={**SMALL, "duration_s": 2.0}, trackers=()))
    for _ in range(30):
        session.advance()
    before_s = session.moment.frame.time_s
    session.change(session.settings.with_axis("stream", session.settings.strongest("stream")))
    assert not session.over
    assert session.simulation.frame_count <= 30, "as many as were shown already"
    assert session.advance().frame.time_s > before_s
    session.close()


def test_a_tracker_given_twice_is_an_error():
    with pytest.raises(ParameterError, match="tracker given twice: stay"):
        replace(PLAIN, trackers=(TrackerSpec(name="stay"), TrackerSpec(name="oracle"), TrackerSpec(name="stay")))


def test_impossible_settings_change_nothing(session: Session):
    session.advance()
    before = session.moment
    with pytest.raises(ScenarioError):
        session.change(session.settings.with_axis("occlusion", 50.0))
    with pytest.raises(UnknownNameError):
        session.change(replace(session.settings, trackers=(TrackerSpec(name="ko2013"),)))
    assert session.moment is before
    assert session.settings is PLAIN
    assert session.advance().frame.index == 2


def test_memory_is_bounded_and_clips_hold_what_was_shown(tmp_path: Path):
    session = Session(replace(PLAIN, trackers=()), memory_mb=0.3)
    try:
        for _ in range(12):
            session.advance()
        assert 2 <= len(session.history) < 10
        assert session.moment.frame.index == 12
        session.save_clip(tmp_path / "clip.mp4", last_s=0.1)
    finally:
        session.close()
    with av.open(str(tmp_path / "clip.mp4")) as clip:
        assert len(list(clip.decode(video=0))) == 3


def test_settings_are_saved_as_a_file_and_as_a_command():
    settings = PLAIN.with_axis("jitter", 1.5)
    assert settings.physical("jitter") == pytest.approx(1.5)
    assert tomllib.loads(settings.toml()) == settings.scenario().tree
    assert "--set axes.jitter.severity=0.9" in settings.command_line()
    assert "--trackers stay,oracle" in settings.command_line()
    assert "pftrack-sim follow" in replace(settings, driver="servo").command_line()
    assert "by hand" in replace(settings, driver="hand").toml()
    with pytest.raises(UnknownNameError, match="did you mean 'servo'"):
        replace(settings, driver="serva")
    with pytest.raises(UnknownNameError, match="stress axis"):
        settings.with_axis("jiter", 1.0)


@pytest.mark.parametrize("name", scenarios.names())
def test_every_scenario_survives_being_written(name: str):
    tree = scenarios.load(name).tree
    assert tomllib.loads(tomli_w.dumps(tree)) == tree


def test_a_missing_viser_is_one_error_that_names_the_extra(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(StudioError, match=r"pip install 'pftrack-sim\[studio\]'"):
        Studio(PLAIN)
