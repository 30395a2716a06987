"""What a layout of a data set does: how its sequences are recognised, read and written."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from pathlib import Path

from pftrack_sim.formats.sequence import Annotations, RecordedSequence


class Layout(ABC):
    """How a data set lays out its sequences."""

    title: str
    """The data set."""
    expects: str
    """Files of a sequence, for messages."""
    image: str
    """Path of an image within the folder of its sequence without its suffix, formatted with its number."""
    first = 1
    """Number of the first image."""
    sequences = "."
    """Folder of the sequences within the data set."""
    needs: frozenset[str] = frozenset()
    """`"masks"` and `"solids"`: what of `PersonBox` it writes besides boxes."""
    packed = False
    """Whether a sequence is a shard: an archive with a text for each image."""
    jpeg = False
    """Whether its readers look for `*.jpg`."""
    video = False
    """Whether a video may stand for the images: no public tool that reads the layout opens or counts them."""

    @abstractmethod
    def matches(self, folder: Path) -> bool:
        """Whether a folder has this layout."""

    @abstractmethod
    def read(self, folder: Path) -> RecordedSequence:
        """Read the sequence in a folder.

        Raises:
            SequenceError: Images or boxes are missing, damaged, or differ in number.
        """

    @abstractmethod
    def write(self, folder: Path, annotations: Annotations) -> None:
        """Write the annotations of a sequence into the folder that holds its images."""

    def index(self, root: Path, names: Sequence[str]) -> Iterator[tuple[str, Iterator[str]]]:
        """Files of the data set in `root` besides its sequences of these names, in pieces, by their path."""
        yield from ()
