"""Trackers of other programs, in any language, through the TraX protocol over standard input and output.

    trackers.make("trax:python my_tracker.py", alpha=0.3)      # properties of the message `initialize`

The program is started when the tracker is made and again at every further `init`, so that nothing remains of an
earlier sequence. What it prints besides messages goes to standard error.

Messages, regions and images follow the public specification (Cehovin 2017, "TraX: the visual Tracking eXchange
protocol"): a message is a line `@@TRAX:kind "argument" ... "key=value" ...`; all other lines are output of the program.
"""

from __future__ import annotations

import base64
import contextlib
import math
import os
import queue
import re
import shutil
import signal
import subprocess
import tempfile
import threading
import weakref
from collections.abc import Collection, Generator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, TypeAlias

import cv2
import numpy as np

from pftrack_sim.core.boxes import Box, region_box
from pftrack_sim.core.errors import ParameterError, TrackerError
from pftrack_sim.core.image_files import encode
from pftrack_sim.core.inputs import environment_of_programs
from pftrack_sim.core.records import Estimate, Image
from pftrack_sim.core.text import one_line
from pftrack_sim.trackers.base import BaseTracker
from pftrack_sim.trackers.parameters import Parameters
from pftrack_sim.trackers.trax import words_of

MAX_LINE_BYTES = 256 * 1024 * 1024
_PREFIX = "@@TRAX:"
_MESSAGE = re.compile(r"[a-z]+(?=\s|$)")
_TOKEN = re.compile(r'\s*(?:"([^"\\]*(?:\\.[^"\\]*)*)"|([^\s"]+))')
_PROPERTY = re.compile(r"([A-Za-z0-9._]{1,64})=(.*)", re.DOTALL)
_ESCAPED = re.compile(r"\\(.)")
_PNG = (".png", cv2.IMWRITE_PNG_COMPRESSION, 1)


@dataclass(frozen=True)
class Message:
    """A message: its kind (`hello`, `initialize`, `frame`, `state`, `quit`), arguments, and named properties."""

    kind: str
    arguments: tuple[str, ...] = ()
    properties: Mapping[str, str] = field(default_factory=dict[str, str])

    def encode(self) -> bytes:
        """The line, with its end."""
        named = [f"{key}={value}" for key, value in self.properties.items()]
        quoted = "".join(f' "{_escape(text)}"' for text in (*self.arguments, *named))
        return f"{_PREFIX}{self.kind}{quoted}\n".encode()


def _escape(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")


def parse(line: bytes) -> Message | None:
    r"""Message of a line; None if the line is output of the program.

    Raises:
        TrackerError: It begins as a message and is none.

    >>> parse(b'@@TRAX:state "1,2,3,4" "confidence=0.5"\n')
    Message(kind='state', arguments=('1,2,3,4',), properties={'confidence': '0.5'})
    """
    if not line.startswith(_PREFIX.encode()):
        return None
    text = line.decode(errors="replace")[len(_PREFIX) :].rstrip()
    kind = _MESSAGE.match(text)
    if kind is None:
        raise TrackerError(f"a TraX message without a kind: {one_line(text, 60)!r}")
    arguments: list[str] = []
    properties: dict[str, str] = {}
    position = kind.end()
    while position < len(text):
        token = _TOKEN.match(text, position)
        if token is None:
            raise TrackerError(f"a TraX message whose quotes do not match: {one_line(text, 60)!r}")
        position = token.end()
        value = token[2] if token[1] is None else _ESCAPED.sub(lambda one: "\n" if one[1] == "n" else one[1], token[1])
        named = _PROPERTY.fullmatch(value)
        if named:
            properties[named[1]] = named[2]
        else:
            arguments.append(value)
    return Message(kind[0], tuple(arguments), properties)


def encode_box(box: Box, formats: Collection[str]) -> str:
    """A box [px] as the first of rectangle, polygon and mask that is in `formats`.

    Raises:
        TrackerError: None of them is.
    """
    x, y, w, h = (float(value) for value in box)
    if "rectangle" in formats:
        return _numbers(x, y, w, h)
    if "polygon" in formats:
        return _numbers(x, y, x + w, y, x + w, y + h, x, y + h)
    if "mask" in formats:
        left, top = max(round(x), 0), max(round(y), 0)
        width, height = max(round(x + w) - left, 1), max(round(y + h) - top, 1)
        return f"mask:{left},{top},{width},{height},0,{width * height}"
    raise TrackerError(f"it takes no rectangle, polygon or mask, but {', '.join(formats) or 'nothing'}")


def _numbers(*values: float) -> str:
    return ",".join(f"{value:.4f}" for value in values)


def decode_box(region: str) -> Box | None:
    """The box [px] around a region; None for an empty one, and for a special code (the target is lost).

    Args:
        region: `x,y,w,h`; a polygon `x,y,x,y,x,y,...`; `mask:x,y,w,h,...` followed by the lengths of runs of pixels
            outside and inside by turns, row by row; or one number, a special code.

    Raises:
        TrackerError: Something else, or numbers that are not finite.

    >>> decode_box("3,2,5,2,4,7").tolist(), decode_box("mask:10,20,5,4,7,2,3,2").tolist()
    ([3.0, 2.0, 2.0, 5.0], [12.0, 21.0, 2.0, 2.0])
    """
    box = region_box(region, mask="mask:")
    if box is None and _is_number(region):
        return None
    if box is None or not np.isfinite(box).all() or (box[2:] < 0.0).any():
        raise TrackerError(f"a region that is no rectangle, polygon or mask: {one_line(region, 60)!r}")
    return box if (box[2:] > 0.0).all() else None


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


HELLO_S = 100.0
"""Time for the greeting, imports and model files included; below that for making an isolated tracker."""

_END_S = 1.0
_QUEUE = 16
_KEY = re.compile(r"[A-Za-z0-9._]{1,64}")

_Received: TypeAlias = "Message | TrackerError | None"


def make(name: str, seed: int, preset: str, properties: Mapping[str, Any]) -> TraxTracker:
    """Make the tracker of `trax:COMMAND`; see `trackers.make`.

    Args:
        name: `trax:` and a command line, which is split like a shell's and run without one.
        seed: Sent to the tracker as the property `seed`.
        preset: Trackers of other programs have one set of values.
        properties: Sent to the tracker.

    Raises:
        ParameterError: No command, no such preset, or a name of a property that TraX does not allow.
        TrackerError: The program does not exist, or ended, or did not say hello.
    """
    words = words_of(name)
    if not words:
        raise ParameterError(f"tracker {name!r}: a command must follow, for example trax:python my_tracker.py")
    Parameters.from_preset(name, preset, {})
    for key in properties:
        if not _KEY.fullmatch(key):
            raise ParameterError(f"tracker {name!r}: a property has up to 64 letters, digits, . and _; got {key!r}")
    texts = {key: str(value).lower() if isinstance(value, bool) else str(value) for key, value in properties.items()}
    return TraxTracker(words, properties={"seed": str(seed), **texts})


class TraxTracker(BaseTracker):
    """A tracker that runs as another program.

    An empty region or a special code means that the target is lost: the last box remains, with confidence 0. Without
    a property `confidence` in its answers the confidence is 1; others are limited to [0, 1].

    Args:
        command: Program and arguments.
        properties: Sent when it is initialised.

    Raises:
        TrackerError: The program does not exist, or ended, or did not say hello.
    """

    def __init__(self, command: list[str], *, properties: Mapping[str, str]) -> None:
        super().__init__()
        self._command, self._properties = command, dict(properties)
        self._session = _Session(command)
        self._fresh = True
        self._box: Box

    def _start(self, image: Image, box: Box) -> None:
        if not self._fresh:
            self._session.close()
            self._session = _Session(self._command)
        self._fresh, self._box = False, box
        self._ask(image, box)

    def _follow(self, image: Image) -> Estimate:
        state = self._ask(image)
        if len(state.arguments) != 1:
            raise TrackerError(f"a TraX state must have one region, got {len(state.arguments)}")
        box = decode_box(state.arguments[0])
        if box is None:
            return Estimate(self._box, 0.0, True)
        self._box = box
        try:
            confidence = float(state.properties.get("confidence", "1"))
        except ValueError:
            raise TrackerError(f"confidence must be a number, got {state.properties['confidence']!r}") from None
        return Estimate(box, min(max(confidence, 0.0), 1.0))

    def _ask(self, image: Image, box: Box | None = None) -> Message:
        """Send an image, with a box to start on, and return the tracker's state."""
        session = self._session
        with _sent(image, session.image_formats) as sent:
            properties = self._properties if box is not None else {}
            if box is None:
                messages = [Message("frame", (sent,))]
            elif session.version < 4:
                messages = [Message("initialize", (sent, encode_box(box, session.region_formats)), properties)]
            else:
                start = Message("initialize", (encode_box(box, session.region_formats),))
                messages = [start, Message("frame", (sent,), properties)]
            return session.ask(messages)


class _Session:
    """The running program and what it said in its greeting."""

    def __init__(self, command: list[str]) -> None:
        self._name = command[0]
        if shutil.which(command[0]) is None:
            raise TrackerError(f"no program {command[0]!r} for a TraX tracker: it is neither a file nor on the PATH")
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env={**environment_of_programs(), "TRAX": "1"},
                start_new_session=True,
            )
        except OSError as error:
            raise TrackerError(f"the TraX tracker {command[0]!r} cannot be started: {error.strerror}") from None
        self.close = weakref.finalize(self, _end, self._process)
        self._received: queue.Queue[_Received] = queue.Queue(_QUEUE)
        assert self._process.stdout is not None
        threading.Thread(target=_receive, args=(self._process.stdout, self._received), daemon=True).start()
        hello = self._next(HELLO_S, "say hello")
        if hello.kind != "hello":
            raise TrackerError(f"its first TraX message must be hello, got {hello.kind!r}")
        try:
            self.version = int(hello.properties.get("trax.version", "1"))
        except ValueError:
            raise TrackerError(f"trax.version must be a number, got {hello.properties['trax.version']!r}") from None
        self.image_formats = _listed(hello, "trax.image", "path")
        self.region_formats = _listed(hello, "trax.region", "rectangle")
        channels = _listed(hello, "trax.channels", "color")
        if channels != ["color"]:
            raise TrackerError(f"it needs the image channels {', '.join(channels)}; there is only color")

    def ask(self, messages: list[Message]) -> Message:
        """Send messages and return the state that answers them."""
        if not self._received.empty():
            raise TrackerError("it sent a TraX message without a request")
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(b"".join(message.encode() for message in messages))
            self._process.stdin.flush()
        except OSError:
            raise self._ended("read its image") from None
        answer = self._next(None, "answer")
        if answer.kind == "quit":
            raise TrackerError(f"it quit: {answer.properties.get('trax.reason', 'no reason given')}")
        if answer.kind != "state":
            raise TrackerError(f"it must answer with the TraX message state, got {answer.kind!r}")
        return answer

    def _next(self, limit_s: float | None, what: str) -> Message:
        try:
            received = self._received.get(timeout=limit_s)
        except queue.Empty:
            self.close()
            raise TrackerError(f"it did not {what} (TraX) within {limit_s:g} s") from None
        if received is None:
            raise self._ended(what)
        if isinstance(received, TrackerError):
            self.close()
            raise received
        return received

    def _ended(self, what: str) -> TrackerError:
        """The error that the program ended instead of doing something."""
        try:
            code = self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            return TrackerError(f"it closed its output instead of going on to {what} (TraX)")
        how = f"with exit code {code}" if code >= 0 else f"by {signal.Signals(-code).name}"
        return TrackerError(f"{self._name} ended {how}; it did not {what} (TraX)")


def _listed(hello: Message, key: str, default: str) -> list[str]:
    return [one for one in hello.properties.get(key, default).split(";") if one]


@contextlib.contextmanager
def _sent(image: Image, formats: list[str]) -> Generator[str]:
    """A contiguous image as the first kind that the tracker takes; a file exists until the tracker has answered."""
    if "memory" in formats:
        height, width = image.shape[:2]
        yield f"image:{width};{height};rgb;{base64.b64encode(image.data).decode()}"
    elif "buffer" in formats or "data" in formats:
        yield f"data:image/png;{base64.b64encode(encode(image, *_PNG)).decode()}"
    elif "path" in formats:
        try:
            with tempfile.TemporaryDirectory(prefix="pftrack-sim-") as folder:
                path = Path(folder).absolute() / "image.png"
                path.write_bytes(encode(image, *_PNG))
                yield f"file://{path}"
        except OSError as error:
            raise TrackerError(f"no image can be written for the tracker: {error.strerror}") from None
    else:
        raise TrackerError(f"it takes no image as path, memory or buffer, but {', '.join(formats) or 'nothing'}")


def _receive(stream: IO[bytes], received: queue.Queue[_Received]) -> None:
    """Put messages into the queue, then None at the end; pass other output on to standard error."""
    with contextlib.suppress(OSError, ValueError):  # closed while it was read
        while line := stream.readline(MAX_LINE_BYTES):
            try:
                message = parse(line)
            except TrackerError as error:
                received.put(error)
                continue
            if message is not None:
                received.put(message)
            else:
                os.write(2, line)
    received.put(None)


def _end(process: subprocess.Popen[bytes]) -> None:
    """Ask a program to quit, then end it with what it started."""
    with contextlib.suppress(OSError, ValueError):
        assert process.stdin is not None
        process.stdin.write(Message("quit").encode())
        process.stdin.close()
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(_END_S)
    with contextlib.suppress(OSError):
        if hasattr(os, "killpg"):
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()
    process.wait()
