"""Messages of a ROS 2 bag in SQLite (`rosbag2_storage_sqlite3`); library: `mcap-ros2-support`, which decodes them.

Table `topics` holds id, name, type and serialization_format, table `messages` topic_id, timestamp [ns] and data. Bags
of ROS 2 Iron on have the definitions of their messages in `message_definitions`; for others those of Humble are taken.
"""

from __future__ import annotations

import importlib
import sqlite3
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

from pftrack_sim.core.errors import SequenceError
from pftrack_sim.core.ros2_messages import definition

_COMPRESSED = b"\x28\xb5\x2f\xfd"
"""First bytes of what Zstandard has compressed."""


class Messages(ExitStack):
    """Messages of an open file."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path = path
        uri = f"{path.absolute().as_uri()}?mode=ro&immutable=1"
        self._database = self.enter_context(closing(sqlite3.connect(uri, uri=True)))
        self._decoders: Any = importlib.import_module("mcap_ros2.decoder").DecoderFactory()
        self._schema: Any = importlib.import_module("mcap.records").Schema

    def topics(self) -> dict[str, str]:
        """Types of messages by topic."""
        return dict(self._database.execute("SELECT name, type FROM topics WHERE serialization_format = 'cdr'"))

    def read(self, topic: str, at_ns: int | None = None) -> Iterator[tuple[int, Any]]:
        """Time of reception [ns] and content of all messages on a topic, or of those of one time."""
        number, kind = self._database.execute("SELECT id, type FROM topics WHERE name = ?", [topic]).fetchone()
        # The decoder keeps one type for each id.
        schema = self._schema(id=number, name=kind, encoding="ros2msg", data=self._definition(kind).encode())
        decode = self._decoders.decoder_for("cdr", schema)
        where, values = (
            ("topic_id = ?", [number]) if at_ns is None else ("topic_id = ? AND timestamp = ?", [number, at_ns])
        )
        rows = f"SELECT timestamp, data FROM messages WHERE {where} ORDER BY timestamp, id"
        for time_ns, data in self._database.execute(rows, values):
            if data.startswith(_COMPRESSED):
                raise SequenceError(f"{self._path}: messages are compressed; see ros2 bag convert")
            yield time_ns, decode(data)

    def _definition(self, kind: str) -> str:
        tables = self._database.execute("SELECT name FROM sqlite_master WHERE name = 'message_definitions'")
        if tables.fetchone():
            wanted = "topic_type = ? AND encoding = 'ros2msg' AND encoded_message_definition <> ''"
            found = self._database.execute(
                f"SELECT encoded_message_definition FROM message_definitions WHERE {wanted}", [kind]
            ).fetchone()
            if found:
                return str(found[0])
        return definition(kind.replace("/msg/", "/"))
