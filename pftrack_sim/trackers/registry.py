"""Trackers by name: ours, those of installed packages, and any `package.module:factory`.

A factory is called as `factory(seed=..., preset=..., **params)` and returns a `records.Tracker`. Installed packages
announce theirs in the entry-point group `pftrack_sim.trackers`; a name of ours cannot be taken.
"""

from __future__ import annotations

import inspect
import operator
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pftrack_sim.core import plugins
from pftrack_sim.core.errors import ParameterError, TrackerError
from pftrack_sim.core.records import Tracker

GROUP = "pftrack_sim.trackers"
PRESETS = ("default", "paper")
"""`paper`: the printed values and nothing else; `default`: the best values found since."""


@dataclass(frozen=True)
class _Known:
    factory: str  # imported when it is made, not before: numba alone would double the time to import this package
    description: str


_OURS = {
    "ko2012": _Known(
        "pftrack_sim.trackers.papers.ko2012:make_proposed",
        "Ko, Nam & Kwak 2012: particle filter on HSV colour and CS-LBP texture",
    ),
    "ko2012-cslbp": _Known(
        "pftrack_sim.trackers.papers.ko2012:make_cslbp", "Ko et al. 2012, method 4: CS-LBP texture alone"
    ),
    "ko2012-hsv": _Known("pftrack_sim.trackers.papers.ko2012:make_hsv", "Ko et al. 2012, method 2: HSV histogram"),
    "ko2012-hsv-kernel": _Known(
        "pftrack_sim.trackers.papers.ko2012:make_hsv_kernel",
        "Ko et al. 2012, method 3: HSV histogram under an Epanechnikov kernel",
    ),
    "ko2012-rgb": _Known("pftrack_sim.trackers.papers.ko2012:make_rgb", "Ko et al. 2012, method 1: RGB histogram"),
    "kwon2005": _Known(
        "pftrack_sim.trackers.papers.kwon2005:make_proposed",
        "Kwon, Kim & Lim: appearance-adaptive particle filter on a grey template",
    ),
    "kwon2005-no-occlusion": _Known(
        "pftrack_sim.trackers.papers.kwon2005:make_no_occlusion", "kwon2005 that never holds the target to be covered"
    ),
    "lee2012": _Known(
        "pftrack_sim.trackers.papers.lee2012:make_proposed",
        "Lee et al. 2012: particle filter on colour and HOG, learnt on line by incremental PCA",
    ),
    "lee2012-checked": _Known(
        "pftrack_sim.trackers.papers.lee2012:make_checked",
        "lee2012 that learns only from what resembles the target; not in the paper",
    ),
    "lee2012-color": _Known(
        "pftrack_sim.trackers.papers.lee2012:make_color", "Lee et al. 2012, compared: colour alone"
    ),
    "lee2012-color-hog": _Known(
        "pftrack_sim.trackers.papers.lee2012:make_color_hog",
        "Lee et al. 2012, compared: colour and HOG, without learning",
    ),
    "ncc": _Known(
        "pftrack_sim.trackers.baselines.template_matching:make_ncc",
        "normalised cross-correlation with the first frame's patch",
    ),
    "opencv-camshift": _Known(
        "pftrack_sim.trackers.baselines.mean_shift:make_camshift",
        "OpenCV's CamShift on the back-projected hue: Bradski 1998",
    ),
    "opencv-csrt": _Known(
        "pftrack_sim.trackers.opencv.classic:make_csrt", "OpenCV's TrackerCSRT; needs opencv-contrib-python-headless"
    ),
    "opencv-dasiamrpn": _Known(
        "pftrack_sim.trackers.opencv.networks:make_dasiamrpn",
        "OpenCV's TrackerDaSiamRPN; needs model files: model, kernel_cls1, kernel_r1",
    ),
    "opencv-kcf": _Known(
        "pftrack_sim.trackers.opencv.classic:make_kcf", "OpenCV's TrackerKCF; needs opencv-contrib-python-headless"
    ),
    "opencv-meanshift": _Known(
        "pftrack_sim.trackers.baselines.mean_shift:make_meanshift",
        "OpenCV's meanShift on the back-projected hue: Bradski 1998",
    ),
    "opencv-medianflow": _Known(
        "pftrack_sim.trackers.opencv.classic:make_medianflow",
        "OpenCV's TrackerMedianFlow; needs opencv-contrib-python-headless",
    ),
    "opencv-mil": _Known(
        "pftrack_sim.trackers.opencv.classic:make_mil", "OpenCV's TrackerMIL: multiple-instance learning"
    ),
    "opencv-mosse": _Known(
        "pftrack_sim.trackers.opencv.classic:make_mosse", "OpenCV's TrackerMOSSE; needs opencv-contrib-python-headless"
    ),
    "opencv-nano": _Known(
        "pftrack_sim.trackers.opencv.networks:make_nano", "OpenCV's TrackerNano; needs model files: backbone, neckhead"
    ),
    "opencv-tld": _Known(
        "pftrack_sim.trackers.opencv.classic:make_tld", "OpenCV's TrackerTLD; needs opencv-contrib-python-headless"
    ),
    "opencv-vit": _Known(
        "pftrack_sim.trackers.opencv.networks:make_vit", "OpenCV's TrackerVit; needs a model file: model"
    ),
    "oracle": _Known("pftrack_sim.trackers.baselines.reference:make_oracle", "told the truth, says the truth"),
    "stay": _Known("pftrack_sim.trackers.baselines.reference:make_stay", "the first box for ever"),
}


_NAMES = plugins.Names(
    kind="tracker",
    group=GROUP,
    error_type=TrackerError,
    ours={name: known.description for name, known in _OURS.items()},
)


def names() -> list[str]:
    """Every name `make` knows, sorted: ours and those of installed packages."""
    return _NAMES.all()


def describe(name: str) -> str:
    """What a tracker is, in one line.

    Args:
        name: One of `names()`.

    Raises:
        UnknownNameError: No such tracker.
    """
    return _NAMES.describe(name)


def make(name: str, *, seed: int = 0, preset: str = "default", **params: Any) -> Tracker:
    """Make a tracker.

    Args:
        name: One of `names()`, or `package.module:factory`.
        seed: Root seed, >= 0. The tracker draws from its stream `"tracker"` only.
        preset: `"default"` or `"paper"`; trackers that have only one set of values take both.
        params: Parameters of the tracker.

    Raises:
        UnknownNameError: No such tracker.
        ParameterError: An unknown preset or parameter, or a value that is not allowed.
        TrackerError: A third party's factory that cannot be loaded, fails, or makes something else.
    """
    try:
        root = operator.index(seed)
    except TypeError:
        raise ParameterError(f"seed must be a whole number >= 0, got {seed!r}") from None
    if root < 0:
        raise ParameterError(f"seed must be a whole number >= 0, got {seed!r}")
    if name in _OURS:
        return plugins.load("tracker", name, _OURS[name].factory, TrackerError)(seed=root, preset=preset, **params)
    return _call(name, _NAMES.load(name), root, preset, params)


def _call(name: str, factory: Callable[..., Any], seed: int, preset: str, params: dict[str, Any]) -> Tracker:
    """Call a third party's factory, and say what is wrong where something is."""
    for extra, error_type in (({}, TrackerError), (params, ParameterError)):
        problem = _refusal(factory, {"seed": seed, "preset": preset, **extra})
        if problem is not None:
            raise error_type(f"tracker {name!r}: its factory, called with (seed, preset, **params), says: {problem}")
    made = _NAMES.call(name, factory, seed=seed, preset=preset, **params)
    if not isinstance(made, Tracker):
        raise TrackerError(f"tracker {name!r}: its factory made a {type(made).__name__} without init and update")
    return made


def _refusal(factory: Callable[..., Any], arguments: dict[str, Any]) -> str | None:
    try:
        signature = inspect.signature(factory)
    except (TypeError, ValueError):
        return None  # a compiled factory shows no signature; the call itself will tell
    try:
        signature.bind(**arguments)
    except TypeError as error:
        return str(error)
    return None
