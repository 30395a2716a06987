"""Sequences in OTB layout: right ones in every spelling, wrong ones with one clear line."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from pftrack_sim.core.errors import SequenceError
from pftrack_sim.formats import read_sequence

BOXES = ["1,1,10,20", "3,4,10.5,20", "5,6,11,21"]


def write(folder: Path, lines: list[str] | str | None = None, *, first: int = 1, count: int = 3) -> Path:
    (folder / "img").mkdir(parents=True)
    for index in range(count):
        image = np.zeros((24, 32, 3), np.uint8)
        image[:, :, 2] = 50 * (index + 1)  # OpenCV writes BGR: this is red
        cv2.imwrite(str(folder / f"img/{index + first:04d}.png"), image)
    text = "\n".join(lines) + "\n" if isinstance(lines, list) else lines
    (folder / "groundtruth_rect.txt").write_text("\n".join(BOXES) + "\n" if text is None else text)
    return folder


def test_boxes_are_moved_to_our_convention(tmp_path: Path):
    sequence = read_sequence(write(tmp_path / "walk"))
    assert sequence.name == "walk"
    assert len(sequence) == 3
    assert sequence.truth.tolist() == [[0, 0, 10, 20], [2, 3, 10.5, 20], [4, 5, 11, 21]]
    assert not sequence.truth.flags.writeable


def test_images_are_read_when_asked_for_as_rgb(tmp_path: Path):
    sequence = read_sequence(str(write(tmp_path / "walk")))
    (tmp_path / "walk/img/0002.png").unlink()
    image = sequence.image(2)
    assert image.shape == (24, 32, 3)
    assert image.dtype == np.uint8
    assert (image == [150, 0, 0]).all()
    with pytest.raises(SequenceError, match=r"0002\.png: no such file"):
        sequence.image(1)


@pytest.mark.parametrize("index", [-1, 3])
def test_there_is_no_such_frame(tmp_path: Path, index: int):
    with pytest.raises(IndexError, match="frames 0 to 2"):
        read_sequence(write(tmp_path / "walk")).image(index)


@pytest.mark.parametrize("separator", [",", "\t", " ", ", ", "  ", " ,\t"])
@pytest.mark.parametrize("ending", ["\n", "\r\n", ""])
def test_every_separator_is_read(tmp_path: Path, separator: str, ending: str):
    folder = write(tmp_path / "walk", "")
    lines = [separator.join(line.split(",")) for line in BOXES]
    (folder / "groundtruth_rect.txt").write_bytes(((ending or "\n").join(lines) + ending).encode())
    assert read_sequence(folder).truth.tolist()[1] == [2, 3, 10.5, 20]


def test_a_byte_order_mark_and_blank_lines_at_the_end_do_no_harm(tmp_path: Path):
    folder = write(tmp_path / "walk", "")
    (folder / "groundtruth_rect.txt").write_bytes(b"\xef\xbb\xbf" + "\n".join(BOXES).encode() + b"\n\n  \n")
    assert len(read_sequence(folder)) == 3


@pytest.mark.parametrize("none", ["NaN,NaN,NaN,NaN", "nan nan nan nan", "0,0,0,0", "5,5,-3,4", "5,5,3,0", "1,2,NaN,4"])
def test_no_truth_becomes_nan(tmp_path: Path, none: str):
    truth = read_sequence(write(tmp_path / "walk", [BOXES[0], none, BOXES[2]])).truth
    assert np.isnan(truth[1]).all()
    assert np.isfinite(truth[[0, 2]]).all()


def test_numbers_may_start_anywhere_and_are_sorted_as_numbers(tmp_path: Path):
    folder = write(tmp_path / "walk", first=9999)
    read = read_sequence(folder)
    assert [Path(read.where(index)).name for index in range(3)] == [
        "9999.png",
        "10000.png",
        "10001.png",
    ]


def test_other_files_beside_the_images_do_no_harm(tmp_path: Path):
    folder = write(tmp_path / "walk")
    for name in (".DS_Store", "._0001.png", "Thumbs.db", "notes.txt"):
        (folder / "img" / name).write_text("")
    assert len(read_sequence(folder)) == 3


@pytest.mark.parametrize("data", [b"", b"no image", b"\x89PNG\r\n\x1a\n"])
def test_a_damaged_image_is_named(tmp_path: Path, data: bytes):
    folder = write(tmp_path / "walk")
    (folder / "img/0002.png").write_bytes(data)
    sequence = read_sequence(folder)
    with pytest.raises(SequenceError, match=r"0002\.png: is not an image"):
        sequence.image(1)
