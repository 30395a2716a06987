"""Recorded frames in place of the simulator, without a browser."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pftrack_sim.benchmark.asked.plan import TrackerSpec
from pftrack_sim.benchmark.running.sinks import video_writer
from pftrack_sim.core.errors import ParameterError, SequenceError, UnknownNameError
from pftrack_sim.formats import read_sequence, read_video
from pftrack_sim.studio import Settings
from pftrack_sim.studio.recording import Camera, RecordedSession

SETTINGS = Settings("film.mp4", 0, {}, (TrackerSpec(name="stay"), TrackerSpec(name="ncc")))
FRAMES = 6


@pytest.fixture
def film(tmp_path: Path) -> Path:
    """A bright pattern on a dark one moves 4 px to the right a frame."""
    rng = np.random.default_rng(1)
    coarse = rng.integers(0, 90, (18, 24, 3), dtype=np.uint8), rng.integers(120, 255, (8, 5, 3), dtype=np.uint8)
    noise, pattern = (np.kron(one, np.ones((4, 4, 1), dtype=np.uint8)) for one in coarse)
    path = tmp_path / "film.mp4"
    with video_writer(path, 10.0) as add:
        for index in range(FRAMES):
            image = noise.copy()
            image[20:52, 10 + 4 * index : 30 + 4 * index] = pattern
            add(image, index / 10.0)
    return path


def square(index: int) -> np.ndarray:
    return np.array([10.0 + 4.0 * index, 20.0, 20.0, 32.0])


def test_trackers_start_with_a_drawn_box_and_nothing_is_scored(film: Path):
    session = RecordedSession(SETTINGS, lambda: read_video(film))
    assert session.rate_hz == 10.0
    assert session.moment.estimates == {}
    session.advance()
    assert session.select_box(square(1)) == "Trackers start with the drawn box."
    moments = [session.advance() for _ in range(2)]
    assert np.array_equal(moments[-1].estimates["stay"].box, square(1))
    assert np.abs(moments[-1].estimates["ncc"].box - square(3)).max() <= 2.0
    assert all(np.isnan(one) for one in moments[-1].overlaps.values())
    assert moments[-1].picture().shape == (72, 96, 3)
    assert [one.frame.index for one in session.history] == [0, 1, 2, 3]
    session.close()


def test_it_goes_back_and_ends(film: Path):
    session = RecordedSession(SETTINGS, lambda: read_video(film))
    shown = [session.moment, *(session.advance() for _ in range(FRAMES - 1))]
    with pytest.raises(ParameterError, match="over: restart"):
        session.advance()
    assert session.over
    session.restart(shown[2])
    assert not session.over
    assert np.array_equal(session.moment.frame.image, shown[2].frame.image)
    assert np.array_equal(session.advance().frame.image, shown[3].frame.image)
    session.close()


def test_a_box_of_the_first_frame_starts_them_and_boxes_of_all_frames_score_them(film: Path):
    truth = np.array([square(index) for index in range(FRAMES)])
    session = RecordedSession(SETTINGS, lambda: read_sequence(film, boxes=truth))
    assert session.moment.overlaps == {"stay": 1.0, "ncc": 1.0}
    session.advance()
    assert session.moment.overlaps["stay"] == pytest.approx(16 / 24)
    said = session.change(replace(SETTINGS, trackers=(TrackerSpec(name="stay"),)))
    assert "true box" in said
    assert session.moment.overlaps == {"stay": 1.0}
    session.close()
    alone = RecordedSession(SETTINGS, lambda: read_sequence(film, boxes=truth[:1]))
    alone.advance()
    alone.change(replace(SETTINGS, trackers=(TrackerSpec(name="ncc"),)))
    assert np.abs(alone.moment.estimates["ncc"].box - square(0)).max() <= 4.0, "the last box of stay"
    alone.close()


def test_what_cannot_be_read_is_named(tmp_path: Path):
    with pytest.raises(SequenceError, match="camera 97: cannot be opened"):
        Camera(97)
    (tmp_path / "text.mp4").write_text("no video")
    with pytest.raises(SequenceError, match=r"text\.mp4: cannot be read as a video"):
        read_video(tmp_path / "text.mp4")


def test_nobody_can_be_selected(film: Path):
    session = RecordedSession(SETTINGS, lambda: read_video(film))
    with pytest.raises(UnknownNameError, match="person"):
        session.select("crosser-1")
    session.close()
