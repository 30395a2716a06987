"""TraX: trackers of other programs here, ours there; the reference implementation is the other side."""

import os
import shutil
import socket
import struct
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pftrack_sim import trackers
from pftrack_sim.core.errors import ParameterError, PftrackError, TrackerError
from pftrack_sim.core.image_files import encode
from pftrack_sim.trackers.isolation import IsolatedTracker, TrackerCode
from pftrack_sim.trackers.trax import client as client_module
from pftrack_sim.trackers.trax.client import Message, TraxTracker, decode_box, encode_box, parse
from pftrack_sim.trackers.trax.server import serve

PROGRAMS = Path(__file__).with_name("trax_programs")
IMAGE = np.random.default_rng(0).integers(0, 256, (24, 32, 3), dtype=np.uint8)
HELLO = '@@TRAX:hello "trax.version=3" "trax.image=memory;" "trax.region=rectangle;"'
STATE = '@@TRAX:state "1,2,3,4"'


def replies(*lines: str) -> TraxTracker:
    return TraxTracker([sys.executable, "-S", str(PROGRAMS / "replies.py"), *lines], properties={})


printable = st.text(st.characters(codec="utf-8", exclude_characters="\r\x0b\x0c\x1c\x1d\x1e\x85\u2028\u2029"))


@given(
    st.lists(printable.filter(lambda text: "=" not in text)),
    st.dictionaries(st.from_regex(r"[\w.]{1,9}", fullmatch=True, alphabet=st.characters(codec="ascii")), printable),
)
def test_a_message_survives_its_line(arguments: list[str], properties: dict[str, str]):
    message = Message("frame", tuple(arguments), properties)
    line = message.encode()
    assert line.count(b"\n") == 1
    assert parse(line) == message


@pytest.mark.parametrize("line", [b"", b"loading\n", b" @@TRAX:state\n", b"\xff\xfe\n"])
def test_other_lines_are_output(line: bytes):
    assert parse(line) is None


@pytest.mark.parametrize("line", [b"@@TRAX:\n", b"@@TRAX:12\n", b'@@TRAX:state "1,2\n', b'@@TRAX:state "1" 2"\n'])
def test_a_line_that_only_begins_as_a_message_is_an_error(line: bytes):
    with pytest.raises(TrackerError, match="TraX message"):
        parse(line)


def test_every_kind_of_region_becomes_the_box_around_it():
    box = np.array([3.0, 2.0, 5.0, 7.0])
    for kind in ("rectangle", "polygon", "mask"):
        assert abs(decode_box(encode_box(box, (kind,))) - box).max() < 1e-9
    assert decode_box("3,2,8,2,5.5,9").tolist() == box.tolist()
    for nothing in ("2", "0,0,0,0", "mask:3,2,5,7,35", "mask:0,0,0,0", "1,2,0,5"):
        assert decode_box(nothing) is None


@given(st.integers(1, 9), st.integers(1, 9), st.data())
def test_a_mask_has_the_extent_of_its_pixels(width: int, height: int, data: st.DataObject):
    flat = np.array(data.draw(st.lists(st.booleans(), min_size=width * height, max_size=width * height)))
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flat, [False]]).astype(int)))
    runs = np.diff(np.concatenate([[0], edges]))
    box = decode_box(",".join(["mask:10", "20", str(width), str(height), *map(str, runs)]))
    rows, columns = np.nonzero(flat.reshape(height, width))
    if not rows.size:
        assert box is None
    else:
        size = [columns.max() - columns.min() + 1, rows.max() - rows.min() + 1]
        assert box.tolist() == [10 + columns.min(), 20 + rows.min(), *size]


@pytest.mark.parametrize(
    "region",
    ["", "foo", "1,2", "1,2,3", "1,2,3,4,5", "1,2,-3,4", "nan,1,2,3", "1e999,1,2,3", "mask:", "mask:1,2,3",
     "mask:0,0,2,2,1,9", "mask:0,0,2,2,-1,2", "mask:0,0,1.5,2,0,2", "m0,0,2,2,0,4"],
)  # fmt: skip
def test_a_region_that_is_none_is_an_error(region: str):
    with pytest.raises(TrackerError, match="no rectangle, polygon or mask"):
        decode_box(region)


@pytest.mark.parametrize(("region", "image"), [("rectangle", "memory"), ("polygon", "path"), ("mask", "buffer")])
def test_a_tracker_written_with_the_library_runs(region: str, image: str):
    pytest.importorskip("trax")
    name = f"trax:{sys.executable} {PROGRAMS / 'with_library.py'} {region} {image}"
    tracker = IsolatedTracker(TrackerCode(name, params={"alpha": 0.5}), seed=3)
    for first in (5.0, 9.0):  # the second start is a new program
        tracker.init(IMAGE, [first, 4.0, 6.0, 8.0])
        for frame in (1, 2):
            estimate = tracker.update(IMAGE)
            assert abs(estimate.box - [first + frame, 4.0, 6.0, 8.0]).max() < 1e-6
            assert estimate.confidence == (IMAGE[0, 0, 0] / 256 if image == "memory" else 0.5)
    tracker.close()
    assert f"started with {image}" in str(tracker.printed)
    assert "'alpha': '0.5'" in str(tracker.printed)


@pytest.mark.skipif(shutil.which("c++") is None, reason="no compiler")
def test_a_tracker_in_another_language_runs(tmp_path: Path):
    program = tmp_path / "mover"
    subprocess.run(["c++", "-o", program, PROGRAMS / "mover.cpp"], check=True)
    tracker = trackers.make(f"trax:{program}")
    tracker.init(IMAGE, np.array([5.0, 4.0, 6.0, 8.0]))
    estimate = tracker.update(IMAGE)
    assert estimate.box.tolist() == [6.0, 4.0, 6.0, 8.0]
    assert estimate.confidence == 1.0
    assert trackers.code_digest(f"trax:{program}")


def test_version_4_gets_its_object_before_the_image(tmp_path: Path):
    log = tmp_path / "log"
    code = f"""
import sys
print('@@TRAX:hello "trax.version=4" "trax.image=memory;"', flush=True)
for line in sys.stdin:
    open({str(log)!r}, 'a').write(line[:30] + '|')
    if 'initialize' not in line: print('{STATE}', flush=True)
"""
    tracker = TraxTracker([sys.executable, "-c", code], properties={"alpha": "1"})
    tracker.init(IMAGE, [5, 4, 6, 8])
    assert tracker.update(IMAGE).box.tolist() == [1, 2, 3, 4]
    kinds = [line.split()[0] for line in log.read_text().split("|") if line]
    assert kinds == ["@@TRAX:initialize", "@@TRAX:frame", "@@TRAX:frame"]


def test_a_lost_target_keeps_the_last_box_without_confidence():
    tracker = replies(HELLO, STATE, STATE, '@@TRAX:state "0"')
    tracker.init(IMAGE, [5, 4, 6, 8])
    assert tracker.update(IMAGE).confidence == 1.0
    lost = tracker.update(IMAGE)
    assert (lost.box.tolist(), lost.confidence, lost.occluded) == ([1, 2, 3, 4], 0.0, True)


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (["silence", ""], "did not say hello .* within 0.5 s"),
        ([STATE, ""], "first TraX message must be hello, got 'state'"),
        (['@@TRAX:hello "trax.version=x"', ""], "trax.version must be a number"),
        (['@@TRAX:hello "trax.channels=color;depth;"', ""], "needs the image channels color, depth"),
        (['@@TRAX:hello "trax.image=url;"', STATE], "takes no image as path, memory or buffer, but url"),
        (['@@TRAX:hello "trax.region=point;"', STATE], "takes no rectangle, polygon or mask, but point"),
        ([HELLO, "die"], "ended with exit code 7; it did not answer"),
        ([HELLO, STATE, "die"], "ended with exit code 7; it did not answer"),
        ([HELLO, STATE, '@@TRAX:state "foo"'], "no rectangle, polygon or mask: 'foo'"),
        ([HELLO, STATE, "@@TRAX:state"], "must have one region, got 0"),
        ([HELLO, STATE, f'{STATE} "5,6,7,8"'], "must have one region, got 2"),
        ([HELLO, STATE, f'{STATE} "confidence=high"'], "confidence must be a number, got 'high'"),
        ([HELLO, STATE, '@@TRAX:quit "trax.reason=no model"'], "it quit: no model"),
        ([HELLO, STATE, "@@TRAX:banana"], "must answer with the TraX message state, got 'banana'"),
        ([HELLO, STATE, '@@TRAX:state "1,2,3,4'], "quotes do not match"),
        ([HELLO, f"{STATE}\n{STATE}", *[STATE] * 40], "without a request"),
    ],
)  # fmt: skip
def test_a_wrong_program_is_one_clear_error(lines: list[str], words: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(client_module, "HELLO_S", 0.5 if lines[0] == "silence" else 20.0)

    def run() -> None:
        tracker = replies(*lines)
        tracker.init(IMAGE, [5, 4, 6, 8])
        # A message too many is noticed at the first update after it has arrived.
        for _ in range(max(2, len(lines) - 2)):
            tracker.update(IMAGE)
            time.sleep(0.01)

    with pytest.raises(PftrackError, match=words) as caught:
        run()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "params", "words"),
    [
        ("trax:", {}, "a command must follow"),
        ("trax:'", {}, "cannot be read"),
        ("trax:no-such-program x", {}, "no program 'no-such-program'"),
        (f"trax:{sys.executable} -c 0", {}, "exit code 0; it did not say hello"),
        (f"trax:{sys.executable} -c 0", {"a-b": 1}, "up to 64 letters"),
    ],
)
def test_a_wrong_command_is_one_clear_error(name: str, params: dict[str, int], words: str):
    with pytest.raises((ParameterError, TrackerError), match=words):
        trackers.make(name, **params)


def test_no_program_and_no_image_stays_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    code = """
import os, sys
print('@@TRAX:hello', flush=True)
for line in sys.stdin: print(f'@@TRAX:state "{os.getpid()},2,3,4"', flush=True)
"""
    tracker = TraxTracker([sys.executable, "-S", "-c", code], properties={})
    tracker.init(IMAGE, [5, 4, 6, 8])
    pid = int(tracker.update(IMAGE).box[0])
    os.kill(pid, 0)
    assert not list(tmp_path.iterdir())
    del tracker
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


def test_the_code_of_a_command_is_what_its_files_hold(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    for name, text in {"mine.py": "import part_of_mine", "part_of_mine.py": "X = 1", "weights.bin": "w"}.items():
        (tmp_path / name).write_text(text)
    names = ["trax:python mine.py weights.bin", "trax:python -m mine --weights weights.bin"]
    before = [trackers.code_digest(name) for name in names]
    for changed in ("part_of_mine.py", "weights.bin"):
        (tmp_path / changed).write_text("X = 2")
        after = [trackers.code_digest(name) for name in names]
        assert all(one != other for one, other in zip(before, after, strict=True))
        before = after
    (tmp_path / "other.py").write_text("")
    assert [trackers.code_digest(name) for name in names] == before
    assert trackers.code_digest("trax:python -c 0") == ""


# The other direction ----------------------------------------------------------------------------------------------


@pytest.fixture
def client():
    """A client of the reference implementation, whose tracker is `pftrack-sim trax ncc`."""
    client = pytest.importorskip("trax.client")
    command = [sys.executable, "-m", "pftrack_sim", "trax", "ncc"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdin
        assert process.stdout
        yield process, client.Client((process.stdin.fileno(), process.stdout.fileno()), log=lambda text: None)


@pytest.mark.slow
def test_the_library_drives_our_tracker_to_the_same_boxes(client: Any, tmp_path: Path):
    trax = pytest.importorskip("trax")
    process, session = client
    frames = [np.roll(IMAGE, shift, axis=1) for shift in range(3)]
    (tmp_path / "a b.png").write_bytes(encode(frames[2], ".png"))
    ours = trackers.make("ncc")
    ours.init(frames[0], np.array([5.0, 4.0, 6.0, 8.0]))
    assert session.tracker_name == "ncc"
    region = trax.Rectangle.create(5, 4, 6, 8)
    session.initialize({"color": trax.MemoryImage.create(frames[0])}, [(region, {})], {})
    sent = [trax.BufferImage.create(encode(frames[1], ".png")), trax.FileImage.create(str(tmp_path / "a b.png"))]
    for image, frame in zip(sent, frames[1:], strict=True):
        expected = ours.update(frame)
        found, _ = session.frame({"color": image}, {}, [])
        assert abs(np.array(found[0][0].bounds()) - expected.box).max() < 1e-4
        assert abs(float(found[0][1]["confidence"]) - expected.confidence) < 1e-6
    session.quit()
    process.stdin.close()
    assert process.wait(20) == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("path", "box", "words"),
    [
        ("nowhere.png", (5, 4, 6, 8), "nowhere.png' cannot be read"),
        ("image.png", (90, 90, 5, 5), "wholly outside"),
        ("large.png", (5, 4, 6, 8), "has 30000 x 30000 pixels"),
    ],
)
def test_a_wrong_request_quits_with_its_reason(client: Any, tmp_path: Path, path: str, box: Any, words: str):
    trax = pytest.importorskip("trax")
    process, session = client
    encoded = encode(IMAGE, ".png")
    (tmp_path / "image.png").write_bytes(encoded)
    (tmp_path / "large.png").write_bytes(encoded[:16] + struct.pack(">II", 30000, 30000) + encoded[24:])
    with pytest.raises(trax.TraxException, match=words):
        session.initialize(
            {"color": trax.FileImage.create(str(tmp_path / path))}, [(trax.Rectangle.create(*box), {})], {}
        )
    assert process.wait(20) == 2


@pytest.mark.slow
def test_a_client_that_dies_within_a_message_is_not_waited_for():
    command = [sys.executable, "-m", "pftrack_sim", "trax", "stay"]
    begun = b'@@TRAX:initialize "data:image/png;base64,iVBOR'
    done = subprocess.run(command, input=begun, capture_output=True, timeout=120)
    assert (done.returncode, done.stderr.splitlines()[-1]) == (2, b"pftrack-sim: the client has gone")


def test_the_oracle_is_not_served():
    with pytest.raises(TrackerError, match="ground truth"):
        serve(trackers.make("oracle"), "oracle")


@pytest.mark.parametrize(("port", "words"), [("free", "nothing listens at port"), ("x", "must be a port")])
def test_a_socket_without_a_client_is_one_clear_error(port: str, words: str, monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("trax")
    if port == "free":
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = str(probe.getsockname()[1])
    monkeypatch.setenv("TRAX_SOCKET", port)
    with pytest.raises(TrackerError, match=words):
        serve(trackers.make("stay"), "stay")
