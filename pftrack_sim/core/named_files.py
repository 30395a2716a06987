"""Digest of a file together with the files that it names: meshes and textures of a scene, the image of a map."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from pathlib import Path

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.inputs import is_file, read_bytes

_TEXTS = (".xml", ".mjcf", ".urdf", ".yaml", ".yml", ".gltf", ".obj", ".mtl")
_FOLDERS = re.compile(r"""\b(?:meshdir|texturedir|assetdir)\s*=\s*["']([^"']+)""")
_NAMES = re.compile(r"""[^\s"'<>,\[\]]+\.[A-Za-z]\w{1,4}\b""")
_MOST_BYTES, _MOST_FILES = 1 << 29, 5000


def named_digest(path: Path) -> str:
    """SHA-256 of a file and of those that it names, wherever they lie: the same on every machine.

    Raises:
        ParameterError: The file cannot be read, or it and those that it names are too many or too large.
    """
    found, left, count = hashlib.sha256(), _MOST_BYTES, 0
    for name, file in _named(path):
        try:
            content = read_bytes(file, left)
        except OSError as error:
            raise ParameterError(f"{file}: cannot be read: {error.strerror or error}") from None
        found.update(f"{name}\0{hashlib.sha256(content).hexdigest()}".encode())
        left, count = left - len(content), count + 1
        if count > _MOST_FILES:
            raise ParameterError(f"{path}: names more than {_MOST_FILES} files")
    return found.hexdigest()[:16]


def _named(path: Path) -> Iterator[tuple[str, Path]]:
    """A file and those that it, or one of them, names: by name, each once."""
    seen, waiting, folders = {path.resolve()}, [("", path)], [path.parent]
    while waiting:
        name, file = waiting.pop()
        yield name, file
        if file.suffix.lower() not in _TEXTS or not is_file(file):
            continue
        text = file.read_text(encoding="utf-8", errors="replace")
        folders += [path.parent / one for one in _FOLDERS.findall(text)]
        for other in sorted(set(_NAMES.findall(text))):
            for candidate in (folder / other for folder in dict.fromkeys([file.parent, *folders])):
                if is_file(candidate) and candidate.resolve() not in seen:
                    seen.add(candidate.resolve())
                    waiting.append((other, candidate))
