"""Result files: what is written is read back, in every format, and found without naming it."""

import re
import struct
from pathlib import Path

import numpy as np
import pytest

from pftrack_sim.core.errors import SequenceError, UnknownNameError
from pftrack_sim.formats.results import (
    RESULT_FORMATS,
    ResultFormat,
    TrackerResult,
    check_format,
    find_results,
    read_result,
    result_files,
)
from pftrack_sim.formats.single_target import region_box

COUNT = 8


def result(seed: int, first: int = 0) -> TrackerResult:
    """Random boxes; the tracker starts in frame `first` and misses frame 5."""
    rng = np.random.default_rng(seed)
    boxes = np.column_stack([rng.uniform(-20, 60, (COUNT, 2)), rng.uniform(1, 30, (COUNT, 2))])
    boxes[[*range(first), 5]] = np.nan
    return TrackerResult(boxes, rng.uniform(1, 9, COUNT), rng.uniform(0, 1, COUNT), first)


def write(root: Path, form: ResultFormat, tracker: str, sequence: str, content: TrackerResult) -> None:
    for name, text in result_files(form, tracker, sequence, content):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)


@pytest.mark.parametrize("first", [0, 2])
@pytest.mark.parametrize("form", RESULT_FORMATS)
def test_what_is_written_is_read_back(tmp_path: Path, form: ResultFormat, first: int):
    contents = {(tracker, name): result(seed, first) for seed, (tracker, name) in enumerate(
        [("alpha", "walk"), ("alpha", "run_001"), ("beta", "walk")]
    )}  # fmt: skip
    for (tracker, name), content in contents.items():
        write(tmp_path, form, tracker, name, content)
    for chosen in (None, form):
        found = find_results(tmp_path, ["walk", "run_001"], chosen)
        assert {(one.tracker, one.sequence): one.form for one in found} == dict.fromkeys(contents, form)
        for one in found:
            read, content = read_result(one, COUNT, form), contents[one.tracker, one.sequence]
            expected = content.boxes.copy()
            if form == "vot":
                expected[first] = np.nan  # the box that was given is not in the file
            np.testing.assert_allclose(read.boxes, expected, atol=6e-6)
            if form != "mot":
                np.testing.assert_allclose(read.ms, content.ms, atol=1e-4)
            if form == "vot":
                assert read.first == first


def test_boxes_of_four_numbers_count_pixels_as_the_data_set_does(tmp_path: Path):
    (tmp_path / "net").mkdir()
    (tmp_path / "net/walk.txt").write_text("11 21 5 6\n0 0 0 0\n")
    (one,) = find_results(tmp_path, ["walk"])
    assert read_result(one, 2, "otb").boxes[0].tolist() == [10, 20, 5, 6]
    assert read_result(one, 2, "got10k").boxes[0].tolist() == [11, 21, 5, 6]
    assert np.isnan(read_result(one, 2, "otb").boxes[1]).all()


def test_repetitions_have_their_own_times(tmp_path: Path):
    folder = tmp_path / "net/walk"
    folder.mkdir(parents=True)
    for number in (1, 2):
        (folder / f"walk_00{number}.txt").write_text("1,2,3,4\n" * 2)
    (folder / "walk_time.txt").write_text("0.01,0.02\n0.03,0.04\n")
    found = find_results(tmp_path, ["walk"])
    assert [one.repetition for one in found] == [1, 2]
    assert [read_result(one, 2, "got10k").ms.tolist() for one in found] == [[10, 30], [20, 40]]


def test_mot_keeps_the_rows_of_several_tracks(tmp_path: Path):
    (tmp_path / "net/data").mkdir(parents=True)
    (tmp_path / "net/data/walk.txt").write_text("1,4,1,1,5,6,0.9,-1,-1,-1\n1,7,11,1,5,6,1\n2,4,2,1,5,6,1\n")
    (one,) = find_results(tmp_path, ["walk"])
    read = read_result(one, 2, "mot")
    assert read.rows is not None
    assert read.rows.tolist() == [[0, 4, 0, 0, 5, 6], [0, 7, 10, 0, 5, 6], [1, 4, 1, 0, 5, 6]]
    assert np.isnan(read.boxes).all()


@pytest.mark.parametrize(
    ("form", "text", "words"),
    [
        ("otb", "1,2,3,4\n", "1 lines but 2 images in walk"),
        ("otb", "1,2,3,4\n1,2,three,4\n", "line 2: expected four numbers"),
        ("got10k", "1,2,3,4\n" * 3, "3 lines but 2 images"),
        ("vot", "1\n2\n", "line 2: the tracker was reset"),
        ("vot", "1\nnothing\n", "line 2: expected a region"),
        ("mot", "3,1,1,1,5,5,1\n", "line 1: frame 3 or identity 1 is wrong"),
        ("mot", "1,1,1\n", "expected frame, identity"),
        ("mot", "1,1,1,1,-5,5,1\n", "line 1: a box has finite numbers"),
        ("mot", "1,1,1,nan,5,5,1\n", "line 1: a box has finite numbers"),
    ],
)
def test_a_broken_file_gives_one_clear_line(tmp_path: Path, form: ResultFormat, text: str, words: str):
    write(tmp_path, form, "alpha", "walk", result(0))
    (one,) = find_results(tmp_path, ["walk"], form)
    one.path.write_text(text)
    with pytest.raises(SequenceError, match=re.escape(words)) as caught:
        read_result(one, 2, form)
    assert str(one.path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_binary_files_of_the_vot_toolkit_hold_the_same_regions(tmp_path: Path):
    parts = [
        struct.pack("<BI", 0, 1), struct.pack("<B4f", 1, 1.5, 2.0, 3.0, 4.25), struct.pack("<B4f", 1, *[0.0] * 4),
        struct.pack("<BH6f", 2, 3, 10, 20, 30, 25, 28, 40), struct.pack("<BhhHHH5H", 3, 3, 4, 4, 2, 5, 1, 2, 2, 1, 2),
    ]  # fmt: skip
    content = struct.pack("<hI", 1, len(parts)) + b"".join(parts)
    lines = "1\n1.5,2,3,4.25\n0,0,0,0\n10,20,30,25,28,40\nm3,4,4,2,1,2,2,1,2\n"
    rows = []
    for name, written in (("text.txt", lines.encode()), ("binary.bin", content)):
        path = tmp_path / name[:4] / "alpha/unsupervised/walk" / f"walk_001{name[-4:]}"
        path.parent.mkdir(parents=True)
        path.write_bytes(written)
        (one,) = find_results(tmp_path / name[:4], ["walk"])
        assert (one.form, one.tracker) == ("vot", "alpha")
        rows.append(read_result(one, 5, "vot").boxes)
    np.testing.assert_array_equal(*rows)
    assert rows[1][3].tolist() == [10, 20, 20, 20]
    for broken in (content[:-1], content + b"x", b"", b"\x02" + content[1:], content[:6] + b"\x09" + content[7:]):
        path.write_bytes(broken)
        with pytest.raises(SequenceError, match=r"walk_001\.bin: is no file of regions of the VOT toolkit"):
            read_result(one, 5, "vot")


def test_wrong_times_are_an_error(tmp_path: Path):
    write(tmp_path, "otb", "alpha", "walk", result(0))
    (one,) = find_results(tmp_path, ["walk"])
    for text, words in (
        ("fast\n" * COUNT, "expected seconds"),
        ("-1\n" * COUNT, "expected seconds"),
        ("0.1\n", "1 lines but 8 images"),
    ):
        (tmp_path / "alpha/times/walk_time.txt").write_text(text)
        with pytest.raises(SequenceError, match=words):
            read_result(one, COUNT, "otb")


def test_absent_ambiguous_and_unknown_results(tmp_path: Path):
    with pytest.raises(SequenceError, match="no such folder"):
        find_results(tmp_path / "none", ["walk"])
    write(tmp_path, "otb", "alpha", "walk", result(0))
    with pytest.raises(SequenceError, match="no results of run"):
        find_results(tmp_path, ["run"])
    write(tmp_path / "again", "otb", "alpha", "walk", result(0))
    with pytest.raises(SequenceError, match="are both results of alpha on walk"):
        find_results(tmp_path, ["walk"])
    with pytest.raises(UnknownNameError, match="did you mean 'got10k'"):
        check_format("got10")


def test_regions_become_boxes():
    rng = np.random.default_rng(0)
    for _ in range(20):
        mask = rng.random((5, 7)) < 0.2
        runs = np.diff(np.flatnonzero(np.diff(np.concatenate([[not mask.flat[0]], mask.ravel(), [not mask.flat[-1]]]))))
        text = f"m{3},{4},7,5,{','.join(map(str, ([0] if mask.flat[0] else []) + runs.tolist()))}"
        rows, columns = np.nonzero(mask)
        expected = [3 + columns.min(), 4 + rows.min(), np.ptp(columns) + 1, np.ptp(rows) + 1]
        box = region_box(text)
        assert box is not None
        assert box.tolist() == expected
    assert region_box("1,2,3") is None
    assert region_box("m1,2,3,1,9,9") is None
    empty = region_box("m0,0,2,2,4")
    assert empty is not None
    assert np.isnan(empty).all()
