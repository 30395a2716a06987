"""OpenCV's networks: errors of model files, and outputs of a mock network."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from pftrack_sim import trackers
from pftrack_sim.core.errors import ParameterError, TrackerError
from pftrack_sim.trackers.opencv import NETWORKS
from tests.trackers.following import Scene

NAMES = sorted(NETWORKS)


@pytest.mark.parametrize("name", NAMES)
def test_missing_model_files_are_named(name: str):
    with pytest.raises(TrackerError, match="needs model files") as caught:
        trackers.make(name)
    for key in NETWORKS[name][1].model_fields:
        assert key in str(caught.value)
        assert key in trackers.describe(name)


@pytest.mark.parametrize("name", NAMES)
def test_an_unreadable_model_file_is_named(name: str, tmp_path: Path):
    empty, noise = tmp_path / "empty.onnx", tmp_path / "noise.onnx"
    empty.touch()
    noise.write_bytes(bytes(range(256)) * 8)
    for path, words in (
        (tmp_path / "absent.onnx", "No such file"),
        (tmp_path, "directory"),
        (empty, "is empty"),
        (noise, "OpenCV cannot read"),
    ):
        with pytest.raises(TrackerError, match=words) as caught:
            trackers.make(name, **dict.fromkeys(NETWORKS[name][1].model_fields, str(path)))
        assert str(caught.value).startswith(name)
        assert str(path) in str(caught.value)


@pytest.mark.parametrize("name", NAMES)
def test_invalid_paths_and_parameters_are_refused(name: str):
    with pytest.raises(ParameterError, match="got 7: input is not a valid path"):
        trackers.make(name, **dict.fromkeys(NETWORKS[name][1].model_fields, 7))
    with pytest.raises(ParameterError, match="weights: unknown key"):
        trackers.make(name, weights="a.onnx")
    with pytest.raises(ParameterError, match="unknown preset"):
        trackers.make(name, preset="papr")


class Network:
    """Mock network: the target moves right, with a score; a negative one is a loss."""

    def __init__(self, options: Any, score: float) -> None:
        self.options, self.score = options, score

    def init(self, image: np.ndarray, box: tuple[int, int, int, int]) -> None:
        assert all(type(one) is int for one in box)
        self.box = box

    def update(self, image: np.ndarray) -> tuple[bool, tuple[int, int, int, int]]:
        x, y, w, h = self.box
        self.box = (x + 3, y, w, h)
        return self.score >= 0, self.box

    def getTrackingScore(self) -> float:
        return self.score


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("score", "confidence"), [(0.4, 0.4), (1.7, 1.0), (-1.0, 0.0)])
def test_box_and_score_of_the_network_are_returned(
    name: str, score: float, confidence: float, scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    images, truth = scene
    file = tmp_path / "model.onnx"
    file.write_bytes(b"model")
    made: list[Network] = []

    def create(options: Any) -> Network:
        made.append(Network(options, score))
        return made[-1]

    monkeypatch.setattr(cv2, NETWORKS[name][0], SimpleNamespace(create=create))
    tracker = trackers.make(name, **dict.fromkeys(NETWORKS[name][1].model_fields, file))
    aliases = {"model": "net"} if name == "opencv-vit" else {}
    assert all(getattr(made[0].options, aliases.get(key, key)) == str(file) for key in NETWORKS[name][1].model_fields)
    for _ in range(2):  # init forgets
        tracker.init(images[0], truth[0])
        estimate = tracker.update(images[1])
        moved = 3.0 if score >= 0 else 0.0
        assert estimate.box.tolist() == (truth[0] + [moved, 0, 0, 0]).tolist()
        assert estimate.confidence == pytest.approx(confidence)
