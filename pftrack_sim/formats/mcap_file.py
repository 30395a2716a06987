"""Messages of an MCAP file; libraries: `mcap`, `mcap-ros2-support`."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from pftrack_sim.core.errors import SequenceError


class Messages(ExitStack):
    """Messages of an open file; its checksums are verified."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        make_reader: Any = importlib.import_module("mcap.reader").make_reader
        decoder: Any = importlib.import_module("mcap_ros2.decoder").DecoderFactory()
        opened = self.enter_context(path.open("rb"))
        self._path, self._reader = path, make_reader(opened, validate_crcs=True, decoder_factories=[decoder])

    def topics(self) -> dict[str, str]:
        """Types of messages by topic."""
        summary = self._reader.get_summary()
        if summary is None:
            raise SequenceError(f"{self._path}: damaged MCAP file: no summary")
        return {one.topic: summary.schemas[one.schema_id].name for one in summary.channels.values() if one.schema_id}

    def read(self, topic: str, at_ns: int | None = None) -> Iterator[tuple[int, Any]]:
        """Time of reception [ns] and content of all messages on a topic, or of those of one time."""
        span = {} if at_ns is None else {"starting_at": at_ns, "ending_at": at_ns}
        for _, _, message, decoded in self._reader.iter_decoded_messages([topic], **span):
            yield message.log_time, decoded
