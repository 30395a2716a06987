"""Data sets written from episodes: the same frames and truth as the simulation's, in every layout."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import cv2
import duckdb
import numpy as np
import pytest

from pftrack_sim import trackers
from pftrack_sim.benchmark import Plan, make_plan
from pftrack_sim.benchmark.datasets.export import export
from pftrack_sim.benchmark.datasets.recorded import evaluate
from pftrack_sim.benchmark.datasets.sequence_writer import TRUTH, frame_tags
from pftrack_sim.core.errors import ParameterError, PftrackError, RunError, ScenarioError, UnknownNameError
from pftrack_sim.core.records import Frame, Truth
from pftrack_sim.formats import LAYOUTS, read_sequence, read_sequences
from pftrack_sim.scenario import load
from pftrack_sim.score import frame_scores, summarise
from pftrack_sim.simulation.simulation import Simulation
from tests.benchmark.small import SMALL

TINY: dict[str, Any] = {**SMALL, "camera.rate_hz": 30}


def plan(seeds: list[int], **overrides: Any) -> Plan:
    return make_plan(["easy/plaza-walk"], ["stay"], seeds, overrides={**TINY, **overrides})


def files(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def episode() -> list[Frame]:
    with Simulation(load("easy/plaza-walk", TINY)) as simulation:
        frames = [simulation.reset(3)]
        return frames + [simulation.advance() for _ in range(simulation.frame_count - 1)]


@pytest.fixture(scope="module")
def scores(episode: list[Frame]) -> list[float]:
    """Mean overlap and centre error of a tracker that is shown the episode itself."""
    tracker = trackers.make("ncc")
    truth = np.array([frame.truth.box for frame in episode])
    tracker.init(episode[0].image, truth[0])
    found = [truth[0], *(tracker.update(frame.image).box for frame in episode[1:])]
    summary = summarise(frame_scores(np.array(found), truth), np.ones(len(truth), bool), np.zeros(len(truth)))
    return [summary.mean_overlap, summary.centre_error_median_px]


@pytest.mark.parametrize(
    "layout", [name if name in ("otb", "mot") else pytest.param(name, marks=pytest.mark.slow) for name in LAYOUTS]
)
def test_a_sequence_has_the_frames_boxes_and_scores_of_the_episode(
    tmp_path: Path, layout: str, episode: list[Frame], scores: list[float]
):
    out = export(plan([3]), tmp_path / "out", layout, image="png")
    folder = out / LAYOUTS[layout].sequences / "easy-plaza-walk-0003"
    read = read_sequence(folder)
    assert len(read) == len(episode)
    for index, frame in enumerate(episode):
        np.testing.assert_array_equal(read.image(index), frame.image)
        np.testing.assert_allclose(read.truth[index], frame.truth.box, atol=1.1e-5)
    if layout not in ("otb", "lasot", "coco", "kitti"):
        assert read.rate_hz == pytest.approx(30.0)
    found = evaluate([read], ["ncc"], [0])[0].summary
    assert [found.mean_overlap, found.centre_error_median_px] == pytest.approx(scores, abs=1e-4)
    sql = "SELECT frame, identity, person, list_extract(box, 1) FROM '{}' WHERE identity = 1 ORDER BY frame"
    rows = duckdb.sql(sql.format(folder / TRUTH)).fetchall()
    assert [row[0] for row in rows] == list(range(len(read)))
    assert {row[2] for row in rows} == {"target"}
    np.testing.assert_allclose([row[3] for row in rows], read.truth[:, 0], atol=6e-6)
    assert json.loads((out / "dataset.json").read_text())["format"] == layout
    for name, pieces in LAYOUTS[layout].index(out, [folder.name]):
        assert (out / name).read_text() == "".join(pieces)


@pytest.mark.parametrize(("layout", "suffix"), [("otb", "jpg"), ("lasot", "jpg"), ("got10k", "jpg"), ("vot", "png")])
def test_images_are_by_default_what_readers_of_the_layout_look_for(tmp_path: Path, layout: str, suffix: str):
    out = export(plan([3]), tmp_path / "out", layout)
    folder = out / LAYOUTS[layout].sequences / "easy-plaza-walk-0003"
    assert {path.suffix for path in folder.rglob("*") if path.suffix in (".png", ".jpg")} == {f".{suffix}"}
    assert read_sequence(folder).image(0).shape == (72, 96, 3)


@pytest.mark.slow
@pytest.mark.parametrize("layout", ["mot", "lasot"])
def test_a_video_stands_for_the_images_and_is_read_back(tmp_path: Path, layout: str, episode: list[Frame]):
    names = ["easy-plaza-walk-0003", "easy-plaza-walk-0004"]
    out = export(plan([3, 4]), tmp_path / "out", layout, image="mp4", quality=5, maps=["masks"])
    whole = files(out)
    assert json.loads(whole["dataset.json"])["image"] == "mp4, H.264, constant rate factor 5"
    folder = out / LAYOUTS[layout].sequences / names[0]
    video = (folder / LAYOUTS[layout].image).with_name("frames.mp4")
    assert [path.name for path in video.parent.iterdir()] == ["frames.mp4"]
    assert len(list((folder / "masks").iterdir())) == len(episode)
    if layout == "mot":
        assert "imExt=.mp4" in (folder / "seqinfo.ini").read_text()
    read = read_sequence(folder)
    assert (len(read), read.name) == (len(episode), names[0])
    for index in (0, len(episode) - 1, 5):
        difference = read.image(index).astype(float) - episode[index].image
        assert 0.0 < np.sqrt((difference**2).mean()) < 6.0
        np.testing.assert_allclose(read.truth[index], episode[index].truth.box, atol=1.1e-5)
    assert [one.error for one in evaluate(read_sequences(out), ["ncc"], [0])] == [None, None]
    # Resumed after a kill that left half a video.
    video.rename(video.with_name(".frames.mp4.part"))
    folder.rename(folder.with_name(f".{names[0]}.part"))
    export(plan([3, 4]), out, layout, image="mp4", quality=5, maps=["masks"])
    assert files(out) == whole


def test_a_video_of_odd_images_is_refused(tmp_path: Path):
    odd = plan([0], **{"camera.height_px": 71})
    with pytest.raises(ScenarioError, match="mp4 needs images of even width and height, got 96 x 71 px"):
        export(odd, tmp_path / "out", "mot", image="mp4")
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_resumed_export_has_the_bytes_of_an_uninterrupted_one(tmp_path: Path):
    whole = export(plan([0, 1, 2]), tmp_path / "whole", "got10k", image="jpg", quality=80)
    resumed = export(plan([0, 1, 2]), tmp_path / "resumed", "got10k", image="jpg", quality=80)
    for path in sorted((resumed / "val/easy-plaza-walk-0001").iterdir()):
        path.unlink()
    (resumed / "val/easy-plaza-walk-0001").rmdir()
    (resumed / "val/.easy-plaza-walk-0001.part").mkdir()
    (resumed / "val/.easy-plaza-walk-0001.part/00000001.jpg").write_bytes(b"half")
    (resumed / "val/list.txt").unlink()
    export(plan([0, 1, 2]), resumed, "got10k", image="jpg", quality=80)
    assert files(whole) == files(resumed)


def test_another_plan_or_foreign_files_are_not_touched(tmp_path: Path):
    out = export(plan([0]), tmp_path / "out", "otb", image="png")
    before = files(out)
    for other, layout, image in ((plan([1]), "otb", "png"), (plan([0]), "vot", "png"), (plan([0]), "otb", "jpg")):
        with pytest.raises(RunError, match="holds another data set"):
            export(other, out, layout, image=image)
    assert files(out) == before
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/thesis.txt").write_text("precious")
    with pytest.raises(RunError, match="not an empty folder"):
        export(plan([0]), tmp_path / "mine", "otb")
    assert files(tmp_path / "mine") == {"thesis.txt": b"precious"}


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"layout": "otbb"}, UnknownNameError, "did you mean 'otb'"),
        ({"image": "gif"}, UnknownNameError, "known: jpg, mp4, png"),
        ({"image": "jpg", "quality": 0}, ParameterError, "quality of jpg must be 1 to 100, got 0"),
        ({"image": "mp4", "quality": 52, "layout": "mot"}, ParameterError, "quality of mp4 must be 0 to 51, got 52"),
        ({"quality": 90, "image": "png"}, ParameterError, "quality of png has no meaning: it is lossless"),
        ({"workers": -1}, ParameterError, "workers must be >= 0, got -1"),
        ({"image": "mp4"}, ParameterError, "tools that read otb need single images, png or jpg"),
        ({"backend": "vulkan"}, PftrackError, "vulkan"),
    ],
)
def test_wrong_options_write_nothing(tmp_path: Path, changes: dict[str, Any], error: type[PftrackError], words: str):
    options = {"layout": "otb", **changes}
    with pytest.raises(error, match=words):
        export(plan([0]), tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_workers_write_the_same_bytes(tmp_path: Path):
    alone = export(plan([0, 1, 2]), tmp_path / "alone", "mot")
    together = export(plan([0, 1, 2]), tmp_path / "together", "mot", workers=2)
    assert files(alone) == files(together)


def test_attributes_of_vot_say_what_changes(episode: list[Frame]):
    def changed(**values: Any) -> Truth:
        return dataclasses.replace(episode[0].truth, image_motion_px=0.0, **values)

    box, pose = episode[0].truth.amodal_box, episode[0].truth.T_world_camera
    turned = pose.copy()
    turned[:3, :3] = pose[:3, :3] @ cv2.Rodrigues(np.array([0.0, 0.0011, 0.0]))[0]
    truths = [changed() for _ in range(40)]
    assert not any(flags.any() for flags in frame_tags(truths, 10.0).values())
    truths[20] = changed(amodal_box=np.array([*box[:2], *(1.26 * box[2:])]))
    truths[30] = changed(luminance=1.4 * truths[0].luminance, T_world_camera=turned)
    truths[10] = dataclasses.replace(truths[0], image_motion_px=0.31 * float(np.sqrt(box[2] * box[3])))
    truths[5] = changed(amodal_box=np.full(4, np.nan), luminance=np.nan)
    found = {name: np.flatnonzero(flags).tolist() for name, flags in frame_tags(truths, 10.0).items()}
    assert found == {
        "size_change": list(range(15, 26)), "illum_change": list(range(25, 36)),
        "motion_change": [10], "camera_motion": [30, 31],
    }  # fmt: skip
