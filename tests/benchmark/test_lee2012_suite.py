"""The episodes after Lee et al. 2012 are as its tables 2 and 3 describe the recordings."""

import itertools

import pytest

from pftrack_sim import scenario
from pftrack_sim.benchmark.asked.suite import load_suite
from pftrack_sim.benchmark.said.claims import compare_with_paper

TABLES = {
    "lee2012/01": (3015, "day", 8),
    "lee2012/02": (2790, "day", 6),
    "lee2012/03": (3545, "day", 6),
    "lee2012/04": (3215, "day", 7),
    "lee2012/05": (774, "night", 3),
    "lee2012/06": (1360, "night", 3),
    "lee2012/07": (1129, "night", 3),
    "lee2012/08": (1347, "night", 3),
}


@pytest.mark.parametrize("name", TABLES)
def test_an_episode_is_as_the_tables_say(name: str):
    frames, when, look_alikes = TABLES[name]
    for seed in range(3):
        settings = scenario.load(name).resolve(seed)
        camera = settings.camera
        assert (settings.frame_count, camera.width_px, camera.height_px, camera.rate_hz) == (frames, 640, 480, 30.0)
        assert settings.robot.route.kind == "beside"
        assert camera.mount == {"right": "left", "left": "right"}[settings.robot.route.side]
        assert (settings.place.kind == "street") == (when == "night")
        passings = settings.axes.distractors.passings_s
        assert len(passings) == look_alikes
        assert passings[-1] + 3.0 < settings.duration_s
        assert settings.axes.distractors.similarity >= 0.7 > settings.distractors.similarity


@pytest.mark.parametrize("name", TABLES)
def test_the_light_changes_suddenly_more_than_once(name: str):
    settings = scenario.load(name).resolve(0)
    light = settings.axes.light
    shares = [light.course(frame / 30.0) for frame in range(settings.frame_count)]
    assert set(shares) == {0.0, 1.0}
    assert sum(one != other for one, other in itertools.pairwise(shares)) >= 3
    assert abs(light.physical) >= 0.9


@pytest.mark.parametrize("seed", range(3))
def test_no_two_are_the_same_recording(seed: int):
    targets = [scenario.load(name).resolve(seed).target for name in TABLES]
    assert len({(target.path_m, round(target.speed_m_s, 6)) for target in targets}) == len(TABLES)
    assert len({target.wardrobe for target in targets}) == len(TABLES)


def test_the_suite_runs_each_of_them():
    suite = load_suite("lee2012")
    assert suite.scenarios == tuple(TABLES)
    for table in suite.tables:
        assert table.columns == tuple(TABLES)
        assert table.weights == tuple(frames for frames, *_ in TABLES.values())


def test_averages_are_the_printed_ones():
    rows = compare_with_paper(load_suite("lee2012").tables[0], [])
    assert [round(row.printed[-1], 1) for row in rows if row.tracker in load_suite("lee2012").trackers] == [
        71.1,
        90.3,
        92.4,
    ]
