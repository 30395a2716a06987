"""Layouts with a file of one target's boxes beside its images: OTB, LaSOT, GOT-10k, VOT."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from pftrack_sim.core import boxes
from pftrack_sim.core.boxes import NO_BOX, Box
from pftrack_sim.core.errors import SequenceError
from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.formats.files import box_lines, number, number_rows, present_boxes, read_text
from pftrack_sim.formats.images import image_suffix, images_in
from pftrack_sim.formats.sequence import Annotations, Layout, RecordedSequence

VOT_EXPERIMENT = "unsupervised"
"""Name of VOT's experiment in which the tracker starts once and is not reset."""


class _SingleTarget(Layout):
    """A line of x, y, w, h for each image."""

    _truth = "groundtruth.txt"
    _first_pixel = 0.0

    def matches(self, folder: Path) -> bool:
        return (folder / self._truth).exists()

    def read(self, folder: Path) -> RecordedSequence:
        truth = self._boxes(folder / self._truth)
        truth[self._gone(folder, len(truth))] = np.nan
        images = images_in(self._images(folder))
        return RecordedSequence.checked(folder, self._truth, images, truth, self._rate_hz(folder))

    def write(self, folder: Path, annotations: Annotations) -> None:
        lines = box_lines(annotations.boxes, first_pixel=self._first_pixel)
        (folder / self._truth).write_text(lines, encoding="utf-8")

    def _images(self, folder: Path) -> Path:
        return folder / Path(self.image).parent

    def _boxes(self, path: Path) -> FloatArray:
        return present_boxes(number_rows(path, "four numbers x, y, w, h", 4), first_pixel=self._first_pixel)

    def _gone(self, folder: Path, count: int) -> BoolArray:
        """`(count,)` frames whose box is not shown."""
        return np.zeros(count, dtype=np.bool_)

    def _rate_hz(self, folder: Path) -> float | None:
        return None


class _Otb(_SingleTarget):
    """OTB (Wu, Lim & Yang 2013): `img/0001.jpg`... and `groundtruth_rect.txt`.

    Boxes are 1-based: x = 1, w = 10 covers the first ten columns, which is x = 0, w = 10 here. NaN or a size that is
    not positive means that the target is absent; the benchmark's own scorer also takes x <= 0 for absent, which no
    1-based box inside the image has.
    """

    jpeg = True
    title, expects = "OTB", "a folder img/ of numbered images and a file groundtruth_rect.txt"
    image = "img/{:04d}"
    _truth, _first_pixel = "groundtruth_rect.txt", 1.0


class _Lasot(_SingleTarget):
    """LaSOT (Fan et al. 2019): `img/00000001.jpg`... and `groundtruth.txt` with 1-based boxes as in OTB.

    `full_occlusion.txt` and `out_of_view.txt` hold a flag per image on one line, separated by commas. Frames with
    either have no box.
    """

    jpeg = True
    title = "LaSOT"
    expects = "a folder img/ of numbered images and the files groundtruth.txt, full_occlusion.txt and out_of_view.txt"
    image, video = "img/{:08d}", True
    _first_pixel = 1.0
    _occlusion, _out = "full_occlusion.txt", "out_of_view.txt"

    def matches(self, folder: Path) -> bool:
        return super().matches(folder) and ((folder / self._occlusion).exists() or (folder / "img").is_dir())

    def _gone(self, folder: Path, count: int) -> BoolArray:
        gone = super()._gone(folder, count)
        for name in (self._occlusion, self._out):
            if (folder / name).exists():
                fields = read_text(folder / name).replace("\n", ",").split(",")
                flags = [field.strip() for field in fields if field.strip()]
                if len(flags) != count or not set(flags) <= {"0", "1"}:
                    raise SequenceError(f"{folder / name}: expected {count} flags 0 or 1, got {len(flags)} values")
                gone |= np.array(flags) == "1"
        return gone

    def write(self, folder: Path, annotations: Annotations) -> None:
        super().write(folder, annotations)
        out = np.array([one is None for one in annotations.target])
        for name, flags in ((self._occlusion, (annotations.visible_fraction == 0.0) & ~out), (self._out, out)):
            (folder / name).write_text(",".join(str(int(flag)) for flag in flags) + "\n", encoding="utf-8")


class _Got10k(_SingleTarget):
    """GOT-10k (Huang et al. 2019): `00000001.jpg`... beside `groundtruth.txt` with 0-based boxes.

    `absence.label` and `cut_by_image.label` hold a flag per line, `cover.label` the visible share in eighths, rounded
    up, so that a target of which one pixel shows has 1; `meta_info.ini` tells the rate. Frames with an absent or
    entirely covered target have no box: the benchmark's scorer leaves out the first frame and those with cover 0.
    """

    jpeg = True
    title = "GOT-10k"
    expects = "numbered images beside groundtruth.txt, absence.label, cut_by_image.label, cover.label and meta_info.ini"
    image, sequences = "{:08d}", "val"
    _absence, _cover, _meta = "absence.label", "cover.label", "meta_info.ini"

    def matches(self, folder: Path) -> bool:
        names = (self._absence, self._cover, self._meta)
        return super().matches(folder) and any((folder / name).exists() for name in names)

    def _gone(self, folder: Path, count: int) -> BoolArray:
        gone = super()._gone(folder, count)
        for name, flag in ((self._absence, 1.0), (self._cover, 0.0)):
            if (folder / name).exists():
                flags = number_rows(folder / name, "one number", 1)[:, 0]
                if len(flags) != count:
                    raise SequenceError(f"{folder / name}: {len(flags)} labels but {count} boxes in {self._truth}")
                gone |= flags == flag
        return gone

    def _rate_hz(self, folder: Path) -> float | None:
        if not (folder / self._meta).exists():
            return None
        found = re.search(r"^anno_fps:\s*([0-9.]+)\s*Hz", read_text(folder / self._meta), re.MULTILINE)
        return float(found[1]) if found and float(found[1]) > 0.0 else None

    def index(self, root: Path, names: Sequence[str]) -> Iterator[tuple[str, Iterator[str]]]:
        yield "val/list.txt", (f"{name}\n" for name in names)

    def write(self, folder: Path, annotations: Annotations) -> None:
        super().write(folder, annotations)
        labels = {
            self._absence: annotations.visible_fraction == 0.0,
            self._cover: np.ceil(8.0 * annotations.visible_fraction),
            "cut_by_image.label": [one is None or one.truncation > 0.0 for one in annotations.target],
        }
        for name, values in labels.items():
            _write_flags(folder / name, values)
        width, height = annotations.image_size_px
        meta = (
            f"[METAINFO]\nurl: none\nbegin: 00:00:00\nend: 00:00:00\nanno_fps: {annotations.rate_hz:g}Hz\n"
            "object_class: person\nmotion_class: walking\nmajor_class: person\nroot_class: person\n"
            f"motion_adverb: simulated\nresolution: ({width}, {height})\n"
        )
        (folder / self._meta).write_text(meta, encoding="utf-8")


class _Vot(_SingleTarget):
    """VOT (Kristan et al.): `color/00000001.jpg`..., `groundtruth.txt` with 0-based boxes.

    The file `sequence` names the channels and tells rate, size and length; every attribute has a file `NAME.tag` with a
    flag per line. `0,0,0,0` means absent, NaN unknown; `occlusion.tag` marks frames in which less than half shows, and
    `visibility.value` holds the visible share. Regions that are no rectangles become the boxes around them.
    """

    title, expects = "VOT", "a folder color/ of numbered images and the files groundtruth.txt and sequence"
    image, sequences = "color/{:08d}", "sequences"
    _sequence, _stack = "sequence", "pftrack-sim.yaml"

    def matches(self, folder: Path) -> bool:
        return super().matches(folder) and ((folder / self._sequence).is_file() or (folder / "color").is_dir())

    def _images(self, folder: Path) -> Path:
        return folder / "color" if (folder / "color").is_dir() else folder

    def _boxes(self, path: Path) -> FloatArray:
        found: list[Box] = []
        for index, line in enumerate(read_text(path).rstrip().splitlines(), start=1):
            box = region_box(line.strip())
            if box is None:
                words = "a rectangle x,y,w,h, a polygon x,y,x,y,... or a mask m..."
                raise SequenceError(f"{path}, line {index}: expected {words}, got {line.strip()[:60]!r}")
            found.append(box)
        return present_boxes(np.array(found, dtype=np.float64).reshape(-1, 4))

    def _rate_hz(self, folder: Path) -> float | None:
        path = folder / self._sequence
        found = re.search(r"^fps=(.*)$", read_text(path), re.MULTILINE) if path.is_file() else None
        try:
            return float(found[1]) if found else None
        except ValueError:
            raise SequenceError(f"{path}: fps must be a number") from None

    def index(self, root: Path, names: Sequence[str]) -> Iterator[tuple[str, Iterator[str]]]:
        # The workspace around the list says what `vot initialize` would, which downloads sequences.
        yield "sequences/list.txt", (f"{name}\n" for name in names)
        yield "config.yaml", iter([f"stack: {self._stack}\nregistry:\n- ./trackers.ini\nsequences: sequences\n"])
        experiment = (
            f"title: pftrack-sim\nexperiments:\n  {VOT_EXPERIMENT}:\n    type: unsupervised\n    repetitions: 1\n"
            "    analyses:\n    - type: average_accuracy\n      name: accuracy\n      burnin: 1\n"
            "    - type: vot.analysis.longterm.AccuracyRobustness\n      name: ar\n"
        )
        yield self._stack, iter([experiment])

    def write(self, folder: Path, annotations: Annotations) -> None:
        super().write(folder, annotations)
        width, height = annotations.image_size_px
        values = {
            "name": annotations.name,
            "channels.color": f"color/%08d{image_suffix(folder / 'color')}",
            "fps": f"{annotations.rate_hz:g}",
            "format": "default",
            "width": width,
            "height": height,
            "length": len(annotations),
        }
        text = "".join(f"{key}={value}\n" for key, value in values.items())
        (folder / self._sequence).write_text(text, encoding="utf-8")
        for name, flags in {"occlusion": annotations.visible_fraction < 0.5, **annotations.tags}.items():
            _write_flags(folder / f"{name}.tag", flags)
        shares = "".join(f"{number(share)}\n" for share in annotations.visible_fraction.tolist())
        (folder / "visibility.value").write_text(shares, encoding="utf-8")


def region_box(text: str) -> Box | None:
    """`(4,)` box [px] around a region, see `core.boxes.region_box`; NaN for a mask without pixels."""
    box = boxes.region_box(text)
    return NO_BOX if text.startswith("m") and box is not None and not box[2:].all() else box


def _write_flags(path: Path, flags: Iterable[float]) -> None:
    path.write_text("".join(f"{int(flag)}\n" for flag in flags), encoding="utf-8")


OTB, LASOT, GOT10K, VOT = _Otb(), _Lasot(), _Got10k(), _Vot()
