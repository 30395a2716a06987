"""Trackers by name: built-in and installed ones, any `package.module:factory`, `mot:MODULE:CLASS`, and `trax:COMMAND`.

A factory takes `seed` and `preset`, is called as `factory(seed=..., preset=..., **params)` and returns a
`records.Tracker`; it is called for every episode unless the tracker has a method `reset(seed)`. Installed packages
announce theirs in the entry-point group `pftrack_sim.trackers`. `trax:` is followed by the command of another program,
`mot:` by a class or function that makes a multi-object tracker from its parameters alone.
"""

from __future__ import annotations

import importlib
import operator
from collections.abc import Callable
from functools import partial
from typing import Any, Literal

from pftrack_sim.core.code_digest import command_digest
from pftrack_sim.core.errors import ParameterError, TrackerError
from pftrack_sim.core.plugins import BuiltIn, Registry
from pftrack_sim.core.records import Tracker
from pftrack_sim.trackers.multi_object.followed import FollowedPerson, MultiObjectTracker
from pftrack_sim.trackers.trax import PREFIX as TRAX
from pftrack_sim.trackers.trax import words_of

MOT = "mot:"
GROUP = "pftrack_sim.trackers"
ORACLES = ("oracle", "oracle-visible")
_FOLLOW_DETECTIONS = frozenset({"bytetrack", "chau2011", "norfair", "ocsort"})
_WITHOUT_RECOGNITION = frozenset({*_FOLLOW_DETECTIONS, *ORACLES, "pftrack", "stay"})
_CONTRIB, _FILES = "needs opencv-contrib-python-headless", "needs model files"
_MOT = "follows detections; needs the extra mot"
_BUILTIN = {  # name: (module, description)
    "bytetrack": ("multi_object.libraries", f"Zhang et al. 2022: ByteTrack of pyxtrackers; {_MOT}"),
    "chau2011": ("relatives.chau2011", "Chau et al. 2011: similarity of features, Kalman filter; follows detections"),
    "deguchi2004": ("relatives.deguchi2004", "Deguchi et al. 2004: mean shift on colour, a particle filter beside it"),
    "islam2009": ("relatives.islam2009", "Islam, Oh & Lee 2009: particle filter on the distance transform of edges"),
    "ko2012": ("papers.ko2012", "Ko, Nam & Kwak 2012: particle filter on HSV colour and CS-LBP texture"),
    "ko2012-classifier": ("relatives.klein2010", "ko2012 with a classifier as likelihood; not in the paper"),
    "ko2012-cslbp": ("papers.ko2012", "Ko et al. 2012, method 4: CS-LBP texture alone"),
    "ko2012-hsv": ("papers.ko2012", "Ko et al. 2012, method 2: HSV histogram"),
    "ko2012-hsv-kernel": ("papers.ko2012", "Ko et al. 2012, method 3: HSV histogram under an Epanechnikov kernel"),
    "ko2012-rgb": ("papers.ko2012", "Ko et al. 2012, method 1: RGB histogram"),
    "khan2011": ("relatives.khan2011", "Khan et al. 2011: particle filter whose particles climb by mean shift"),
    "klein2010": ("relatives.klein2010", "Klein et al. 2010: particle filter on a classifier boosted every frame"),
    "kwon2005": ("papers.kwon2005", "Kwon, Kim & Lim: appearance-adaptive particle filter on a grey template"),
    "kwon2005-no-occlusion": ("papers.kwon2005", "kwon2005 without occlusion detection"),
    "lee2012": ("papers.lee2012", "Lee et al. 2012: particle filter on colour and HOG, with incremental PCA"),
    "lee2012-checked": ("papers.lee2012", "lee2012 that learns from reliable estimates only; not in the paper"),
    "lee2012-color": ("papers.lee2012", "Lee et al. 2012, compared: colour alone"),
    "lee2012-color-hog": ("papers.lee2012", "Lee et al. 2012, compared: colour and HOG, without learning"),
    "ncc": ("baselines", "normalised cross-correlation with the first frame's patch"),
    "norfair": ("multi_object.libraries", f"norfair's Tracker on the overlap of boxes; {_MOT}"),
    "ocsort": ("multi_object.libraries", f"Cao et al. 2023: OC-SORT of pyxtrackers; {_MOT}"),
    "opencv-camshift": ("baselines", "OpenCV's CamShift on the back-projected hue: Bradski 1998"),
    "opencv-csrt": ("opencv", f"OpenCV's TrackerCSRT; {_CONTRIB}"),
    "opencv-dasiamrpn": ("opencv", f"OpenCV's TrackerDaSiamRPN; {_FILES}: model, kernel_cls1, kernel_r1"),
    "opencv-kcf": ("opencv", f"OpenCV's TrackerKCF; {_CONTRIB}"),
    "opencv-meanshift": ("baselines", "OpenCV's meanShift on the back-projected hue: Bradski 1998"),
    "opencv-medianflow": ("opencv", f"OpenCV's TrackerMedianFlow; {_CONTRIB}"),
    "opencv-mil": ("opencv", "OpenCV's TrackerMIL: multiple-instance learning"),
    "opencv-mosse": ("opencv", f"OpenCV's TrackerMOSSE; {_CONTRIB}"),
    "opencv-nano": ("opencv", f"OpenCV's TrackerNano; {_FILES}: backbone, neckhead"),
    "opencv-tld": ("opencv", f"OpenCV's TrackerTLD; {_CONTRIB}"),
    "opencv-vit": ("opencv", "OpenCV's TrackerVit; needs a model file: model"),
    "oracle": ("reference", "the ground truth"),
    "oracle-visible": ("reference", "the ground truth while at least a tenth of the target is visible"),
    "pftrack": ("pftrack.tracker", "correlation filter with colour, scale, camera motion and an occlusion test"),
    "sidibe2010": ("relatives.sidibe2010", "Sidibe et al. 2010: particle filter on colour and visual saliency"),
    "stay": ("reference", "the first box in every frame"),
    "yang2005": ("relatives.yang2005", "Yang et al. 2005: quasi-random particles through a cascade of observations"),
}


def _make_builtin(module: str, name: str, /, **arguments: Any) -> Tracker:
    # Imported on first use: numba alone would double the time to import this package.
    return importlib.import_module(f"pftrack_sim.trackers.{module}").make(name, **arguments)


_REGISTRY = Registry[Tracker](
    kind="tracker",
    group=GROUP,
    error_type=TrackerError,
    interface=Tracker,
    methods=("init", "update"),
    builtin={
        name: BuiltIn(partial(_make_builtin, module, name), text, f"pftrack_sim.trackers.{module}")
        for name, (module, text) in _BUILTIN.items()
    },
)
_MULTI_OBJECT = Registry[MultiObjectTracker](
    kind="multi-object tracker",
    group="pftrack_sim.multi_object_trackers",
    error_type=TrackerError,
    interface=MultiObjectTracker,
    methods=("update",),
    builtin={},
)
names = _REGISTRY.names
describe = _REGISTRY.describe


def factory(name: str) -> Callable[..., Any]:
    """The factory of a tracker in Python, imported; errors are those of `make`."""
    if name.startswith(MOT):
        return _MULTI_OBJECT.factory(name.removeprefix(MOT))
    return _REGISTRY.factory(name)


def code_digest(name: str) -> str:
    """Digest of a tracker's code, see `core.code_digest`.

    Raises:
        UnknownNameError: No such tracker.
        ParameterError: The command of a TraX tracker cannot be split into words.
    """
    if name.startswith(MOT):
        return _MULTI_OBJECT.code_digest(name.removeprefix(MOT))
    return command_digest(words_of(name)) if name.startswith(TRAX) else _REGISTRY.code_digest(name)


def is_builtin(name: str) -> bool:
    """Whether a tracker belongs to this package; others run in a process of their own by default."""
    return name in _BUILTIN


def recognises(name: str) -> bool:
    """Whether a tracker has the parameter `recognition`, see `BaseTracker`."""
    return name in _BUILTIN and name not in _WITHOUT_RECOGNITION and not name.startswith("opencv-")


def told(name: str) -> Literal["", "truth", "detections"]:
    """What a tracker of this package, or one given by `mot:`, is told of each frame besides its image."""
    if name in ORACLES:
        return "truth"
    return "detections" if name.startswith(MOT) or name in _FOLLOW_DETECTIONS else ""


def make(name: str, *, seed: int = 0, preset: str = "default", **params: Any) -> Tracker:
    """Make a tracker.

    Args:
        name: One of `names()`, `package.module:factory`, `mot:package.module:factory` of a multi-object tracker, of
            which one person is followed, or `trax:COMMAND`.
        seed: Root seed, >= 0. The tracker draws from its stream `"tracker"` only.
        preset: `"default"` or `"paper"`; equal for trackers with one set of values.
        params: Parameters of the tracker.

    Raises:
        UnknownNameError: No such tracker.
        ParameterError: An unknown preset or parameter, or a value that is not allowed.
        TrackerError: A third-party factory cannot be loaded, fails, or makes something else.
    """
    if not isinstance(name, str):  # pyright: ignore[reportUnnecessaryIsInstance] - callers may be untyped
        raise ParameterError(f"a tracker is given by its name or as 'package.module:factory', got {name!r}")
    try:
        root = operator.index(seed)
    except TypeError:
        root = -1
    if root < 0:
        raise ParameterError(f"seed must be a whole number >= 0, got {seed!r}")
    if name.startswith(TRAX):
        return importlib.import_module("pftrack_sim.trackers.trax.client").make(name, root, preset, params)
    if name.startswith(MOT):
        make_one = partial(_MULTI_OBJECT.make, name.removeprefix(MOT), params)
        make_one()  # What is wrong is said now, not in the first frame.
        return FollowedPerson(make_one)
    return _REGISTRY.make(name, params, seed=root, preset=preset)
