"""The thread that plays a session."""

import threading
import time
from collections.abc import Callable

import pytest

from pftrack_sim.benchmark.asked.plan import TrackerSpec
from pftrack_sim.core.errors import ScenarioError, UnknownNameError
from pftrack_sim.studio import Session, Settings
from pftrack_sim.studio.player import Player

SMALL = {"camera.width_px": 64, "camera.height_px": 48, "lights.shadows": False, "duration_s": 1.0}
PLAIN = Settings("easy/corridor", 1, SMALL, (TrackerSpec(name="stay"),))


def until(true: Callable[[], bool]) -> None:
    for _ in range(3000):
        if true():
            return
        time.sleep(0.02)
    raise AssertionError("it did not happen within a minute")


def test_it_plays_to_the_end_and_does_what_is_asked_in_between():
    player = Player(lambda: Session(PLAIN))
    try:
        assert player.ask(lambda session: session.moment.frame.index) == 0
        threads = player.ask(lambda _: threading.current_thread().name)
        assert threads == "pftrack-sim studio", "graphics contexts belong to one thread"
        player.speed, player.playing = 1e6, True
        player.request(lambda session: session.change(session.settings.with_axis("noise", 20.0)))
        until(lambda: not player.playing)
        assert player.status == "The episode is over."
        assert player.moment.frame.index == 29
        assert player.session.settings.physical("noise") == pytest.approx(20.0)
    finally:
        player.close()
    player.close()


def test_errors_are_reported_where_they_belong():
    with pytest.raises(UnknownNameError):
        Player(lambda: Session(Settings("easy/coridor")))
    player = Player(lambda: Session(PLAIN))
    try:
        with pytest.raises(ScenarioError):
            player.ask(lambda session: session.change(session.settings.with_axis("occlusion", 50.0)))
        assert "occlusion" in player.status
        player.request(lambda session: 1 / 0)
        assert player.ask(lambda session: session.moment.frame.index) == 0, "it goes on"
        assert player.status == "ZeroDivisionError: division by zero"
    finally:
        player.close()
