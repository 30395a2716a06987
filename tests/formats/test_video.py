"""Sequences in video files: frames in any order, boxes given apart, and errors in one line."""

import struct
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from pftrack_sim.core.errors import SequenceError
from pftrack_sim.core.image_files import MAX_PIXELS
from pftrack_sim.formats import given_boxes, read_sequence
from tests.cli.test_cli import pftrack_sim

COUNT = 12


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bright square that moves right; frame k has the grey level 10 k."""
    path = tmp_path_factory.mktemp("video") / "walk.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=20, options={"crf": "5"})
        stream.width, stream.height, stream.pix_fmt = 96, 64, "yuv420p"
        for index in range(COUNT):
            image = np.full((64, 96, 3), 10 * index, dtype=np.uint8)
            image[20:44, 10 + 2 * index : 34 + 2 * index] = 250
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        container.mux(stream.encode())
    return path


def boxes() -> np.ndarray:
    return np.array([[10.0 + 2 * index, 20.0, 24.0, 24.0] for index in range(COUNT)])


def test_frames_come_in_any_order(film: Path):
    sequence = read_sequence(film, boxes=given_boxes("10,20,24,24"))
    assert (sequence.name, len(sequence), sequence.rate_hz) == ("walk", COUNT, 20.0)
    assert np.isnan(sequence.truth[1:]).all()
    for index in (0, 1, 5, 4, 11, 0):
        assert abs(float(sequence.image(index)[:10].mean()) - 10 * index) < 4


def test_a_file_has_one_box_or_one_for_each_frame(film: Path, tmp_path: Path):
    lines = [",".join(map(str, row)) for row in boxes().tolist()]
    (tmp_path / "first.txt").write_text(lines[0] + "\n")
    assert read_sequence(film, boxes=given_boxes(str(tmp_path / "first.txt"))).truth[0].tolist() == [10, 20, 24, 24]
    lines[0] = lines[4] = "0,0,0,0"
    (tmp_path / "all.txt").write_text("\n".join(lines))
    sequence = read_sequence(film, boxes=given_boxes(str(tmp_path / "all.txt")))
    assert (len(sequence), sequence.start) == (COUNT - 1, 1)
    assert abs(float(sequence.image(0)[:10].mean()) - 10) < 4
    assert np.isnan(sequence.truth[3]).all()


def test_evaluate_scores_a_video_with_its_boxes(film: Path, tmp_path: Path):
    np.savetxt(tmp_path / "boxes.txt", boxes(), delimiter=",")
    done = pftrack_sim(
        "evaluate", str(film), "--box", str(tmp_path / "boxes.txt"), "--tracker", "oracle", "--seeds", "0"
    )
    assert done.returncode == 0, done.stderr
    assert "1.000" in done.stdout


def test_what_is_wrong_is_said_in_one_line(film: Path, tmp_path: Path):
    (tmp_path / "two.txt").write_text("1,2,3,4\n5,6,7,8\n")
    (tmp_path / "broken.mp4").write_bytes(film.read_bytes()[:300])
    (tmp_path / "notes.txt").write_text("no video")
    for given, box, words in (
        (film, None, "needs the box of its first frame"),
        (film, "1,2,3", "a box is x,y,w,h"),
        (film, "1,2,0,4", "a box is x,y,w,h"),
        (film, str(tmp_path / "absent.txt"), "absent.txt: no such file"),
        (film, str(tmp_path / "two.txt"), "12 frames but 2 boxes"),
        (tmp_path / "broken.mp4", "1,2,3,4", "cannot be read as a video"),
        (tmp_path / "notes.txt", "1,2,3,4", "cannot be read as a video"),
    ):
        done = pftrack_sim("evaluate", str(given), *(["--box", box] if box else []), "--seeds", "0")
        assert done.returncode == 2
        assert words in done.stderr.replace("\n", " ")


@pytest.mark.parametrize("announced", [(30000, 30000), (8000, 8000)])
def test_a_moving_picture_with_too_many_pixels_is_refused_before_it_is_decoded(
    announced: tuple[int, int], tmp_path: Path
):
    content = bytearray(cv2.imencode(".gif", np.zeros((48, 64, 3), np.uint8))[1].tobytes())
    struct.pack_into("<HH", content, 6, *announced)
    (tmp_path / "large.gif").write_bytes(content)
    with pytest.raises(SequenceError, match=f"large.gif: cannot be read as a video: .*more than {MAX_PIXELS} pixels"):
        read_sequence(tmp_path / "large.gif", boxes=given_boxes("1,2,3,4")).image(0)


def test_frames_with_too_many_pixels_are_refused_wherever_they_come(film: Path, monkeypatch: pytest.MonkeyPatch):
    sequence = read_sequence(film, boxes=given_boxes("10,20,24,24"))
    sequence.image(1)
    monkeypatch.setattr("pftrack_sim.formats.images.MAX_PIXELS", 96 * 64 - 1)
    with pytest.raises(SequenceError, match="more than 6143 pixels"):
        sequence.image(0)


def test_a_video_that_breaks_off_is_an_error(film: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(
        "pftrack_sim.formats.images._decode", lambda path, first: (np.zeros((4, 4, 3), np.uint8) for _ in "ab")
    )
    sequence = read_sequence(film, boxes=given_boxes("10,20,24,24"))
    with pytest.raises(SequenceError, match="frame 5 cannot be decoded"):
        sequence.image(4)
