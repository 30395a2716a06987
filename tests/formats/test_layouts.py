"""Layouts of public data sets: what is written is read back, and each is told apart from the others."""

import os
import re
import shutil
import tarfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from pftrack_sim.core.errors import SequenceError, UnknownNameError
from pftrack_sim.core.types import FloatArray
from pftrack_sim.formats import LAYOUTS, Annotations, PersonBox, find_sequences, read_sequence, webdataset

SIZE = (64, 48)
COUNT = 6


def annotations(seed: int = 0, *, absent: tuple[int, ...] = (2,)) -> Annotations:
    """Random boxes; the target is covered in the frames `absent`, and out of view in the last of them."""
    rng = np.random.default_rng(seed)
    boxes = np.column_stack([rng.uniform(0, 40, (COUNT, 2)), rng.uniform(3, 20, (COUNT, 2))])
    boxes[0, :2] = 0.0  # Against the left and upper border, where scorers that take x = 0 for absent would err.
    visible = rng.uniform(0.05, 1.0, COUNT)
    visible[list(absent)] = 0.0
    other = person(2, np.array([1.0, 2.0, 3.0, 4.0]), 0.5)
    targets = [person(1, *one, 0.25 * (i == 1)) for i, one in enumerate(zip(boxes, visible.tolist(), strict=True))]
    people = tuple((other,) if i == absent[-1] else (one, other) for i, one in enumerate(targets))
    return Annotations("walk", 25.0, SIZE, people)


def person(identity: int, box: FloatArray, share: float, truncation: float = 0.0) -> PersonBox:
    """A person with everything that a layout writes; what is seen is only there if a share of it is visible."""
    seen = share > 0.0
    place = tuple(box.tolist())
    solid = (1.7, 0.5, 0.4, 0.1, 1.0, 4.0, 0.2)
    return PersonBox(
        identity, place, share, truncation, place if seen else (), (7, 3, SIZE[0] * SIZE[1] - 10) if seen else (), solid
    )


def write(root: Path, layout: str, content: Annotations) -> Path:
    """Write a data set of one sequence; returns the sequence's folder."""
    known = LAYOUTS[layout]
    folder = root / known.sequences / content.name
    folder.mkdir(parents=True)
    for index in range(len(content)):
        # OpenCV writes BGR: this is red.
        _, image = cv2.imencode(".png", np.full((SIZE[1], SIZE[0], 3), (0, 0, index), dtype=np.uint8))
        name = known.image.format(index + known.first)
        if known.packed:
            with tarfile.open(folder / webdataset.SHARD, "a") as shard:
                text = webdataset.sample(content.name, index, index / content.rate_hz, content.people[index])
                webdataset.add_member(shard, f"walk/{name}.png", image.tobytes())
                webdataset.add_member(shard, f"walk/{name}.json", text)
        else:
            (folder / f"{name}.png").parent.mkdir(exist_ok=True)
            (folder / f"{name}.png").write_bytes(image.tobytes())
    known.write(folder, content)
    for name, pieces in known.index(root, [content.name]):
        (root / name).parent.mkdir(exist_ok=True)
        (root / name).write_text("".join(pieces))
    return folder


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("layout", LAYOUTS)
def test_what_is_written_is_read_back_without_naming_the_layout(tmp_path: Path, layout: str, seed: int):
    content = annotations(seed)
    folder = write(tmp_path, layout, content)
    assert find_sequences(tmp_path) == [(folder, layout)]
    for read in (read_sequence(folder), read_sequence(str(folder), layout)):
        np.testing.assert_allclose(read.truth, content.boxes, atol=1.1e-5)
        assert not read.truth.flags.writeable
        for index in range(COUNT):
            image = read.image(index)
            assert (image.shape, image.dtype) == ((SIZE[1], SIZE[0], 3), np.uint8)
            assert (image == [index, 0, 0]).all()
        assert read.name == "walk"
        assert read.rate_hz == (None if layout in ("otb", "lasot", "coco", "kitti") else pytest.approx(25.0))


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_sequence_begins_where_the_target_is_first_seen(tmp_path: Path, layout: str):
    content = annotations(absent=(0, 1))
    read = read_sequence(write(tmp_path, layout, content))
    assert len(read) == COUNT - 2
    np.testing.assert_allclose(read.truth, content.boxes[2:], atol=1.1e-5)
    assert read.image(0)[0, 0, 0] == 2


@pytest.mark.parametrize("first", LAYOUTS)
@pytest.mark.parametrize("second", LAYOUTS)
def test_a_sequence_converted_to_another_layout_has_the_same_boxes(tmp_path: Path, first: str, second: str):
    content = annotations(5)
    once = read_sequence(write(tmp_path / "one", first, content)).truth
    people = tuple(
        tuple(replace(one, box=tuple(box)) if one.identity == 1 and box[0] >= 0.0 else one for one in everybody)
        for everybody, box in zip(content.people, once.tolist(), strict=True)
    )
    again = read_sequence(write(tmp_path / "two", second, replace(content, people=people))).truth
    np.testing.assert_allclose(again, once, atol=2.2e-5)


def test_one_based_layouts_have_no_box_at_zero(tmp_path: Path):
    for layout, name in (("otb", "groundtruth_rect.txt"), ("lasot", "groundtruth.txt"), ("mot", "gt/gt.txt")):
        first = (write(tmp_path / layout, layout, annotations()) / name).read_text().splitlines()[0].split(",")
        x, y = first[2:4] if layout == "mot" else first[:2]
        assert (x, y) == ("1", "1")


def test_labels_of_got10k(tmp_path: Path):
    content = annotations()
    folder = write(tmp_path, "got10k", content)
    cover = [int(line) for line in (folder / "cover.label").read_text().split()]
    assert cover == [0 if v == 0.0 else int(np.ceil(8.0 * v)) for v in content.visible_fraction]
    assert (folder / "absence.label").read_text().split() == ["0", "0", "1", "0", "0", "0"]
    assert (folder / "cut_by_image.label").read_text().split() == ["0", "1", "1", "0", "0", "0"], "out of view, too"


def test_flags_of_lasot_tell_covered_from_out_of_view(tmp_path: Path):
    folder = write(tmp_path, "lasot", annotations(absent=(2, 4)))
    assert (folder / "full_occlusion.txt").read_text() == "0,0,1,0,0,0\n"
    assert (folder / "out_of_view.txt").read_text() == "0,0,0,0,1,0\n"


def test_polygons_of_vot_become_the_boxes_around_them(tmp_path: Path):
    folder = write(tmp_path, "vot", annotations())
    lines = (folder / "groundtruth.txt").read_text().splitlines()
    lines[1] = "10,20,30,25,28,40,8,35"
    lines[3] = "nan,nan,nan,nan"
    (folder / "groundtruth.txt").write_text("\n".join(lines) + "\n")
    truth = read_sequence(folder).truth
    np.testing.assert_array_equal(truth[1], [8, 20, 22, 20])
    assert np.isnan(truth[3]).all()


def test_mot_lists_everybody_in_view(tmp_path: Path):
    folder = write(tmp_path, "mot", annotations())
    rows = np.loadtxt(folder / "gt/gt.txt", delimiter=",")
    assert rows.shape == (2 * COUNT - 1, 9)
    assert set(rows[:, 1]) == {1.0, 2.0}
    np.testing.assert_array_equal(rows[rows[:, 1] == 2.0][:, 2:6], np.tile([2.0, 3.0, 3.0, 4.0], (COUNT, 1)))


def rewrite(folder: Path, change: Callable[[str, bytes], tuple[str, bytes] | None]) -> None:
    """Write a shard anew, with each member changed, or left out."""
    with tarfile.open(folder / webdataset.SHARD) as shard:
        members = [(one.name, shard.extractfile(one).read()) for one in shard]
    with tarfile.open(folder / webdataset.SHARD, "w") as shard:
        for name, content in filter(None, (change(*one) for one in members)):
            webdataset.add_member(shard, name, content)


def without(part: str) -> Callable[[str, bytes], tuple[str, bytes] | None]:
    return lambda name, content: None if part in name else (name, content)


def with_box(text: bytes) -> Callable[[str, bytes], tuple[str, bytes]]:
    found = rb'"box": (\[[^]]*\]|null)(?=, "people")'
    return lambda name, content: (name, re.sub(found, text, content) if name.endswith("json") else content)


def instances(folder: Path) -> Path:
    return folder.parent.parent / "annotations/instances.json"


def labels(folder: Path) -> Path:
    return folder.parent.parent / "label_02/walk.txt"


def replace_text(path: Path, old: str, new: str) -> None:
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))


def empty(folder: Path) -> None:
    shutil.rmtree(folder)
    folder.mkdir()


def a_file(folder: Path) -> None:
    shutil.rmtree(folder)
    folder.write_text("")


def truth(text: str | bytes) -> Callable[[Path], None]:
    raw = text.encode() if isinstance(text, str) else text
    return lambda folder: (folder / "groundtruth_rect.txt").write_bytes(raw) and None


def rename(old: str, new: str) -> Callable[[Path], None]:
    return lambda folder: (folder / old).rename(folder / new) and None


BROKEN: list[tuple[str, Callable[[Path], object], str]] = [
    ("otb", shutil.rmtree, "walk: no such folder"),
    ("otb", a_file, "walk: is not a folder"),
    ("otb", empty, "walk: not a sequence in a known layout (OTB: a folder img/ of numbered"),
    ("otb", lambda folder: [one.unlink() for one in (folder / "img").iterdir()], "img: no images"),
    ("otb", lambda folder: shutil.rmtree(folder / "img"), "img: no such folder"),
    ("otb", rename("groundtruth_rect.txt", "gt.txt"), "walk: not a sequence in a known layout"),
    ("otb", truth(""), "groundtruth_rect.txt: is empty"),
    ("otb", truth("\n \n"), "groundtruth_rect.txt: is empty"),
    ("otb", truth(b"\xff\xfe\x00\x01"), "groundtruth_rect.txt: is not a text file"),
    ("otb", truth("1,1,5,5\n1,2,3,four\n"), "groundtruth_rect.txt, line 2: expected four numbers x, y, w, h"),
    ("otb", truth("1,1,5,5\n1,1,5,5\n1,2,3\n"), "line 3: expected four numbers"),
    ("otb", truth("1,1,5,5,9\n1,1,5,5\n1,1,5,5\n"), "line 1: expected four numbers"),
    ("otb", truth("1,1,5,5\n\n1,1,5,5\n"), "line 2: expected four numbers"),
    ("otb", truth("1,1,5,5\n1,1,inf,5\n1,1,5,5\n"), "line 2: expected finite numbers"),
    ("otb", truth("NaN,NaN,NaN,NaN\n" * 6), "groundtruth_rect.txt: no frame has a box"),
    ("otb", truth("1,1,5,5\n" * 2), "walk: 6 images but 2 boxes in groundtruth_rect.txt"),
    ("otb", truth("1,1,5,5\n" * 8), "walk: 6 images but 8 boxes in groundtruth_rect.txt"),
    ("otb", rename("img/0002.png", "img/0007.png"), "image 2 is missing between 0001.png and 0003.png"),
    ("otb", rename("img/0003.png", "img/2.png"), "0002.png and 2.png have the same number"),
    ("otb", rename("img/0002.png", "img/two.png"), "two.png: an image's name must be its number"),
    ("lasot", lambda folder: (folder / "full_occlusion.txt").write_text("0,1\n"), "expected 6 flags"),
    ("lasot", lambda folder: (folder / "out_of_view.txt").write_text("0,0,no,0,0,0\n"), "expected 6 flags"),
    (
        "lasot",
        lambda folder: (folder / "img/frames.mp4").write_bytes(b"0000"),
        "mp4: cannot be read as a video: Invalid",
    ),
    ("got10k", lambda folder: (folder / "cover.label").write_text("8\n8\n"), "2 labels but 6 boxes"),
    ("got10k", lambda folder: (folder / "absence.label").write_text("a\n" * 6), "expected one number"),
    ("vot", lambda folder: (folder / "groundtruth.txt").write_text("1,2,3\n" * 6), "expected a rectangle"),
    ("vot", lambda folder: (folder / "sequence").write_text("fps=fast\n"), "fps must be a number"),
    ("mot", lambda folder: (folder / "gt/gt.txt").write_text("9,1,1,1,5,5,1,1,1\n"), "frame 9 of 6 images"),
    ("mot", lambda folder: (folder / "gt/gt.txt").write_text("1,1,1,1\n"), "expected frame, identity"),
    ("mot", lambda folder: (folder / "gt/gt.txt").write_text("1,2,1,1,5,5,1,1,1\n"), "no frame has a box"),
    ("mot", lambda folder: (folder / "seqinfo.ini").write_text("frameRate=25\n"), "seqinfo.ini: File contains no"),
    ("mot", lambda folder: (folder / "gt/gt.txt").write_bytes(b"\xff\xfe"), "is not a text file"),
    ("coco", lambda folder: instances(folder).write_text("{"), "instances.json: Invalid JSON"),
    ("coco", lambda folder: instances(folder).write_text('{"images": []}'), "annotations: Field required"),
    ("coco", lambda folder: replace_text(instances(folder), "[1.0, 2.0", '["one", 2.0'), "bbox.0: Input should be a"),
    (
        "coco",
        lambda folder: replace_text(instances(folder), "[1.0, 2.0", "[NaN, 2.0"),
        "bbox.0: Input should be a finite",
    ),
    ("coco", lambda folder: replace_text(instances(folder), '"track_id": 1', '"track_id": 3'), "no frame has a box"),
    ("coco", lambda folder: (folder / "00000006.png").unlink(), "00000006.png is listed, but there is no such image"),
    ("coco", lambda folder: (folder / "00000007.png").write_bytes(b""), "00000007.png is not listed"),
    ("kitti", lambda folder: labels(folder).write_text("0 1 Pedestrian 0 0 none\n"), "line 1: expected frame, track"),
    ("kitti", lambda folder: replace_text(labels(folder), "5 2 Ped", "6 2 Ped"), "frame 6, but images are 0 to 5"),
    ("kitti", lambda folder: (folder / "000005.png").unlink(), "frame 5, but images are 0 to 4"),
    ("kitti", lambda folder: (folder / "000003.png").unlink(), "image 3 is missing"),
    ("kitti", lambda folder: labels(folder).write_text(""), "no frame has a box"),
    ("webdataset", lambda folder: (folder / "frames.tar").write_bytes(b"text" * 500), "is no tar file"),
    ("webdataset", lambda folder: (folder / "frames.tar").write_bytes(b""), "is no tar file"),
    ("webdataset", lambda folder: os.truncate(folder / "frames.tar", 4000), "is no tar file, or it is damaged"),
    ("webdataset", lambda folder: rewrite(folder, without("02.json")), "00000002 has no json"),
    ("webdataset", lambda folder: rewrite(folder, without("02.png")), "00000002 has no image"),
    ("webdataset", lambda folder: rewrite(folder, without("00000002")), "has frame 2, expected 1"),
    ("webdataset", lambda folder: rewrite(folder, with_box(b'"box": [1, 2, 3]')), "box.3: Field required"),
    ("webdataset", lambda folder: rewrite(folder, with_box(b'"box": "none"')), "box: Input should be a valid"),
    ("webdataset", lambda folder: rewrite(folder, with_box(b'"box": null')), "no frame has a box"),
]


@pytest.mark.parametrize(("layout", "harm", "words"), BROKEN)
def test_a_broken_sequence_gives_one_clear_line(
    tmp_path: Path, layout: str, harm: Callable[[Path], object], words: str
):
    folder = write(tmp_path, layout, annotations())
    harm(folder)
    with pytest.raises(SequenceError, match=re.escape(words)) as caught:
        read_sequence(folder)
    assert str(tmp_path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_unknown_layout_is_named(tmp_path: Path):
    with pytest.raises(UnknownNameError, match="did you mean 'got10k'"):
        read_sequence(tmp_path, "got10")


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_missing_file_is_named_when_the_layout_is_given(tmp_path: Path, layout: str):
    folder = write(tmp_path, layout, annotations())
    truth = {
        "otb": "groundtruth_rect.txt", "mot": "gt/gt.txt", "coco": "../../annotations/instances.json",
        "kitti": "../../label_02/walk.txt", "webdataset": "frames.tar",
    }.get(layout, "groundtruth.txt")  # fmt: skip
    (folder / truth).unlink()
    with pytest.raises(SequenceError, match=rf"{Path(truth).name}: (no such|cannot be read: No such)"):
        read_sequence(folder, layout)


BOXES = ["1,1,10,20", "3,4,10.5,20", "5,6,11,21"] * 2


@pytest.fixture
def otb(tmp_path: Path) -> Path:
    """A sequence in the layout of OTB."""
    folder = write(tmp_path, "otb", annotations())
    truth("\n".join(BOXES) + "\n")(folder)
    return folder


@pytest.mark.parametrize("index", [-1, COUNT])
def test_there_is_no_such_frame(otb: Path, index: int):
    with pytest.raises(IndexError, match="frames 0 to 5"):
        read_sequence(otb).image(index)


@pytest.mark.parametrize("separator", [",", "\t", " ", ", ", "  ", " ,\t"])
@pytest.mark.parametrize("ending", ["\n", "\r\n", ""])
def test_every_separator_is_read(otb: Path, separator: str, ending: str):
    lines = [separator.join(line.split(",")) for line in BOXES]
    truth((ending or "\n").join(lines) + ending)(otb)
    assert read_sequence(otb).truth[:3].tolist() == [[0, 0, 10, 20], [2, 3, 10.5, 20], [4, 5, 11, 21]]


def test_a_byte_order_mark_and_blank_lines_at_the_end_do_no_harm(otb: Path):
    truth(b"\xef\xbb\xbf" + "\n".join(BOXES).encode() + b"\n\n  \n")(otb)
    assert len(read_sequence(otb)) == COUNT


@pytest.mark.parametrize("none", ["NaN,NaN,NaN,NaN", "nan nan nan nan", "0,0,0,0", "5,5,-3,4", "5,5,3,0", "1,2,NaN,4"])
def test_no_truth_becomes_nan(otb: Path, none: str):
    truth("\n".join([BOXES[0], none, *BOXES[2:]]))(otb)
    assert np.isnan(read_sequence(otb).truth).all(axis=1).tolist() == [False, True, *[False] * 4]
    assert np.isfinite(read_sequence(otb).truth[[0, *range(2, COUNT)]]).all()


def test_numbers_may_start_anywhere_and_are_sorted_as_numbers(otb: Path):
    for number in range(COUNT, 0, -1):
        rename(f"img/{number:04d}.png", f"img/{9996 + number}.png")(otb)
    read = read_sequence(otb)
    assert [Path(read.where(index)).name for index in range(COUNT)] == [f"{9997 + index}.png" for index in range(COUNT)]


def test_other_files_beside_the_images_do_no_harm(otb: Path):
    for name in (".DS_Store", "._0001.png", "Thumbs.db", "notes.txt"):
        (otb / "img" / name).write_text("")
    assert len(read_sequence(otb)) == COUNT


@pytest.mark.parametrize("data", [None, b"", b"no image", b"\x89PNG\r\n\x1a\n"])
def test_a_missing_or_damaged_image_is_named_when_it_is_asked_for(otb: Path, data: bytes | None):
    sequence, path = read_sequence(otb), otb / "img/0002.png"
    path.unlink() if data is None else path.write_bytes(data)
    assert sequence.image(2).shape == (SIZE[1], SIZE[0], 3)
    with pytest.raises(SequenceError, match=rf"0002\.png: {'no such file' if data is None else 'is not an image'}"):
        sequence.image(1)
