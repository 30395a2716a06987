"""Layouts of public data sets: what is written is read back, and each is told apart from the others."""

import re
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from pftrack_sim.core.errors import SequenceError, UnknownNameError
from pftrack_sim.formats import LAYOUTS, Annotations, PersonBox, read_sequence

SIZE = (64, 48)
COUNT = 6


def annotations(seed: int = 0, *, absent: tuple[int, ...] = (2,)) -> Annotations:
    """Random boxes; the target is covered in the frames `absent`, and out of view in the last of them."""
    rng = np.random.default_rng(seed)
    boxes = np.column_stack([rng.uniform(0, 40, (COUNT, 2)), rng.uniform(3, 20, (COUNT, 2))])
    boxes[0, :2] = 0.0  # Against the left and upper border, where scorers that take x = 0 for absent would err.
    visible = rng.uniform(0.05, 1.0, COUNT)
    boxes[list(absent)], visible[list(absent)] = np.nan, 0.0
    out = np.zeros(COUNT, dtype=bool)
    out[list(absent)[-1:]] = True
    people = tuple(
        tuple(
            PersonBox(identity, (*(float(v) for v in box),), float(share))
            for identity, box, share in ((1, boxes[i], visible[i]), (2, np.array([1.0, 2.0, 3.0, 4.0]), 0.5))
            if np.isfinite(box).all()
        )
        for i in range(COUNT)
    )
    truncation = np.where(np.arange(COUNT) == 1, 0.25, 0.0)
    return Annotations("walk", 25.0, SIZE, boxes, visible, truncation, out, people)


def write(folder: Path, layout: str, content: Annotations) -> Path:
    for index in range(len(content)):
        path = folder / f"{LAYOUTS[layout].image.format(index + 1)}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(path), np.full((SIZE[1], SIZE[0], 3), index, dtype=np.uint8))
    LAYOUTS[layout].write(folder, content)
    return folder


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("layout", LAYOUTS)
def test_what_is_written_is_read_back_without_naming_the_layout(tmp_path: Path, layout: str, seed: int):
    content = annotations(seed)
    folder = write(tmp_path / "walk", layout, content)
    for read in (read_sequence(folder), read_sequence(folder, layout)):
        np.testing.assert_allclose(read.truth, content.boxes, atol=6e-6)
        assert [int(read.image(index)[0, 0, 0]) for index in range(COUNT)] == list(range(COUNT))
        assert read.name == "walk"
        assert read.rate_hz == (None if layout in ("otb", "lasot") else 25.0)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_sequence_begins_where_the_target_is_first_seen(tmp_path: Path, layout: str):
    content = annotations(absent=(0, 1))
    read = read_sequence(write(tmp_path / "walk", layout, content))
    assert len(read) == COUNT - 2
    np.testing.assert_allclose(read.truth, content.boxes[2:], atol=6e-6)
    assert read.image(0)[0, 0, 0] == 2


@pytest.mark.parametrize("first", LAYOUTS)
@pytest.mark.parametrize("second", LAYOUTS)
def test_a_sequence_converted_to_another_layout_has_the_same_boxes(tmp_path: Path, first: str, second: str):
    content = annotations(5)
    once = read_sequence(write(tmp_path / "one", first, content)).truth
    again = read_sequence(
        write(tmp_path / "two", second, Annotations(**{**content.__dict__, "boxes": np.array(once)}))
    ).truth
    # MOT's boxes are those of the people; all others are written from the boxes read.
    np.testing.assert_allclose(again, once, atol=1.2e-5)


def test_one_based_layouts_have_no_box_at_zero(tmp_path: Path):
    for layout, name in (("otb", "groundtruth_rect.txt"), ("lasot", "groundtruth.txt"), ("mot", "gt/gt.txt")):
        first = (write(tmp_path / layout, layout, annotations()) / name).read_text().splitlines()[0].split(",")
        x, y = first[2:4] if layout == "mot" else first[:2]
        assert (x, y) == ("1", "1")


def test_labels_of_got10k(tmp_path: Path):
    content = annotations()
    folder = write(tmp_path / "walk", "got10k", content)
    cover = [int(line) for line in (folder / "cover.label").read_text().split()]
    assert cover == [0 if v == 0.0 else int(np.ceil(8.0 * v)) for v in content.visible_fraction]
    assert (folder / "absence.label").read_text().split() == ["0", "0", "1", "0", "0", "0"]
    assert (folder / "cut_by_image.label").read_text().split() == ["0", "1", "0", "0", "0", "0"]


def test_flags_of_lasot_tell_covered_from_out_of_view(tmp_path: Path):
    folder = write(tmp_path / "walk", "lasot", annotations(absent=(2, 4)))
    assert (folder / "full_occlusion.txt").read_text() == "0,0,1,0,0,0\n"
    assert (folder / "out_of_view.txt").read_text() == "0,0,0,0,1,0\n"


def test_polygons_of_vot_become_the_boxes_around_them(tmp_path: Path):
    folder = write(tmp_path / "walk", "vot", annotations())
    lines = (folder / "groundtruth.txt").read_text().splitlines()
    lines[1] = "10,20,30,25,28,40,8,35"
    lines[3] = "nan,nan,nan,nan"
    (folder / "groundtruth.txt").write_text("\n".join(lines) + "\n")
    truth = read_sequence(folder).truth
    np.testing.assert_array_equal(truth[1], [8, 20, 22, 20])
    assert np.isnan(truth[3]).all()


def test_mot_lists_everybody_in_view(tmp_path: Path):
    folder = write(tmp_path / "walk", "mot", annotations())
    rows = np.loadtxt(folder / "gt/gt.txt", delimiter=",")
    assert rows.shape == (2 * COUNT - 1, 9)
    assert set(rows[:, 1]) == {1.0, 2.0}
    np.testing.assert_array_equal(rows[rows[:, 1] == 2.0][:, 2:6], np.tile([2.0, 3.0, 3.0, 4.0], (COUNT, 1)))


BROKEN: list[tuple[str, Callable[[Path], object], str]] = [
    ("lasot", lambda folder: (folder / "full_occlusion.txt").write_text("0,1\n"), "expected 6 flags"),
    ("lasot", lambda folder: (folder / "out_of_view.txt").write_text("0,0,no,0,0,0\n"), "expected 6 flags"),
    ("got10k", lambda folder: (folder / "cover.label").write_text("8\n8\n"), "2 labels but 6 boxes"),
    ("got10k", lambda folder: (folder / "absence.label").write_text("a\n" * 6), "expected one number"),
    ("vot", lambda folder: (folder / "groundtruth.txt").write_text("1,2,3\n" * 6), "expected a rectangle"),
    ("vot", lambda folder: (folder / "sequence").write_text("fps=fast\n"), "fps must be a number"),
    ("mot", lambda folder: (folder / "gt/gt.txt").write_text("9,1,1,1,5,5,1,1,1\n"), "frame 9 of 6 images"),
    ("mot", lambda folder: (folder / "gt/gt.txt").write_text("1,1,1,1\n"), "expected frame, identity"),
    ("mot", lambda folder: (folder / "gt/gt.txt").write_text("1,2,1,1,5,5,1,1,1\n"), "no frame has a box"),
    ("mot", lambda folder: (folder / "seqinfo.ini").write_text("frameRate=25\n"), "seqinfo.ini: File contains no"),
    ("mot", lambda folder: (folder / "gt/gt.txt").write_bytes(b"\xff\xfe"), "is not a text file"),
]


@pytest.mark.parametrize(("layout", "harm", "words"), BROKEN)
def test_a_broken_sequence_gives_one_clear_line(
    tmp_path: Path, layout: str, harm: Callable[[Path], object], words: str
):
    folder = write(tmp_path / "walk", layout, annotations())
    harm(folder)
    with pytest.raises(SequenceError, match=re.escape(words)) as caught:
        read_sequence(folder)
    assert str(folder) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_unknown_layout_is_named(tmp_path: Path):
    with pytest.raises(UnknownNameError, match="did you mean 'got10k'"):
        read_sequence(tmp_path, "got10")


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_missing_file_is_named_when_the_layout_is_given(tmp_path: Path, layout: str):
    folder = write(tmp_path / "walk", layout, annotations())
    truth = {"otb": "groundtruth_rect.txt", "mot": "gt/gt.txt"}.get(layout, "groundtruth.txt")
    (folder / truth).unlink()
    with pytest.raises(SequenceError, match=f"{truth}: no such file"):
        read_sequence(folder, layout)
