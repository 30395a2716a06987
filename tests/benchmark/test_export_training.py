"""Formats for training, and the maps beside images: read back with the public libraries, and against the frames."""

import json
from pathlib import Path
from typing import Any

import cv2
import duckdb
import numpy as np
import pytest

from pftrack_sim.benchmark import make_plan
from pftrack_sim.benchmark.datasets.export import export
from pftrack_sim.core.errors import ScenarioError, UnknownNameError
from pftrack_sim.formats.maps import encode_depth, encode_flow
from pftrack_sim.scenario import load
from pftrack_sim.simulation.simulation import Simulation

TINY: dict[str, Any] = {
    "camera.width_px": 160, "camera.height_px": 120, "camera.rate_hz": 10, "duration_s": 0.4, "lights.shadows": False,
}  # fmt: skip
MAPS = ("depth", "masks", "flow")
NAME = "corridor-0002"


@pytest.fixture(scope="module")
def coco(tmp_path_factory: pytest.TempPathFactory) -> Path:
    plan = make_plan(["corridor"], ["stay"], [2], overrides=TINY)
    return export(plan, tmp_path_factory.mktemp("coco") / "out", "coco", maps=MAPS)


def decode_masks(content: bytes) -> np.ndarray:
    decoded = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
    assert decoded.dtype == np.uint16
    return decoded


def decode_depth(content: bytes) -> np.ndarray:
    values = decode_masks(content)
    return np.where(values > 0, values / 256.0, np.inf)


def decode_flow(content: bytes) -> tuple[np.ndarray, np.ndarray]:
    blue, green, red = np.moveaxis(decode_masks(content).astype(float), 2, 0)
    flow = (np.stack([red, green], axis=2) - 32768.0) / 64.0
    return np.where(blue[..., None] > 0, flow, 0.0), blue > 0


def maps_of(folder: Path, kind: str) -> list[bytes]:
    return [path.read_bytes() for path in sorted((folder / kind).iterdir())]


def test_coco_reads_masks_and_boxes_of_visible_pixels(coco: Path):
    from pycocotools import mask as tools
    from pycocotools.coco import COCO

    found = COCO(coco / "annotations/instances.json")
    masks = [decode_masks(content) for content in maps_of(coco / "images" / NAME, "masks")]
    assert len(found.imgs) == len(masks) == 4
    seen = 0
    for image in found.imgs.values():
        assert (coco / "images" / image["file_name"]).is_file()
        for one in found.loadAnns(found.getAnnIds(imgIds=image["id"])):
            mask = found.annToMask(one).astype(bool)
            np.testing.assert_array_equal(mask, masks[image["frame"]] == one["track_id"])
            assert one["area"] == mask.sum()
            np.testing.assert_array_equal(tools.toBbox(found.annToRLE(one)), one["bbox"])
            seen += 1
    rows = duckdb.sql(
        f"SELECT frame, identity, visible_box, visible_fraction FROM '{coco}/images/{NAME}/truth.parquet' "
        "WHERE state = 'visible'"
    ).fetchall()
    assert len(rows) == seen >= 4
    by_key = {(found.imgs[one["image_id"]]["frame"], one["track_id"]): one for one in found.anns.values()}
    for frame, identity, box, share in rows:
        assert by_key[frame, identity]["bbox"] == list(box)
        assert by_key[frame, identity]["visible_fraction"] == pytest.approx(share, abs=1e-6)


def test_depth_and_flow_are_those_of_the_scene(coco: Path):
    folder = coco / "images" / NAME
    depths = [decode_depth(content) for content in maps_of(folder, "depth")]
    flows = [decode_flow(content) for content in maps_of(folder, "flow")]
    assert (len(depths), len(flows)) == (4, 3)
    with Simulation(load("corridor", TINY)) as simulation:
        simulation.reset(2)
        for index in range(4):
            geometry = simulation.scene_geometry()
            known = np.isfinite(geometry.depth_m)
            assert np.abs(depths[index] - geometry.depth_m)[known].max() <= 0.5 / 256 + 1e-9
            # The floor is at height 0, whatever the pose of the camera: depth is right where it is seen.
            rows, columns = np.nonzero(known)
            slopes = np.linalg.inv(geometry.view.K) @ np.stack([columns + 0.5, rows + 0.5, np.ones(len(rows))])
            points = geometry.view.T_world_camera[:3, :3] @ (slopes * geometry.depth_m[known])
            height = points[2] + geometry.view.T_world_camera[2, 3]
            names = np.array([simulation.world.model.geom(int(one)).name for one in geometry.ids[known]])
            floor = np.char.find(names, "floor") >= 0
            assert floor.sum() > 1000
            assert np.abs(height[floor]).max() < 0.01
            if index == 3:
                break
            simulation.advance()
            flow, valid = flows[index]
            exact, _ = geometry.flow_to(simulation.scene_geometry())
            assert np.abs(flow - exact)[valid].max() <= 0.5 / 64 + 1e-9


def test_colours_move_along_the_flow():
    """What a pixel shows is where the flow leads: colours there differ far less than at the same pixel."""
    with Simulation(load("corridor", {**TINY, "duration_s": 2})) as simulation:
        first = simulation.reset(2)
        before = simulation.scene_geometry()
        for _ in range(8):
            last = simulation.advance()
        flow, valid = before.flow_to(simulation.scene_geometry())
    there = np.indices(valid.shape)[::-1].transpose(1, 2, 0) + flow
    moved = cv2.remap(last.image, there.astype(np.float32), None, cv2.INTER_LINEAR).astype(float)
    inside = valid & ((there >= 1) & (there <= np.array(valid.shape[::-1]) - 2)).all(axis=2)
    led, stayed = (np.abs(other - first.image.astype(float)).mean(axis=2)[inside] for other in (moved, last.image))
    assert np.abs(flow[inside]).mean() > 1.0
    assert led.mean() < 0.4 * stayed.mean()


@pytest.mark.slow
def test_kitti_boxes_in_space_enclose_those_in_the_image(tmp_path: Path):
    plan = make_plan(["corridor"], ["stay"], [2], overrides=TINY)
    out = export(plan, tmp_path / "out", "kitti")
    lines = (out / f"calib/{NAME}.txt").read_text().splitlines()
    projection = np.array([float(value) for value in lines[2].split()[1:]]).reshape(3, 4)
    labels = [line.split() for line in (out / f"label_02/{NAME}.txt").read_text().splitlines()]
    assert {row[2] for row in labels} == {"Pedestrian"}
    assert [row[0] for row in labels if row[1] == "1"] == ["0", "1", "2", "3"]
    for row in labels:
        left, top, right, bottom, h, w, length, x, y, z, turn = (float(value) for value in row[6:])
        assert 1.2 < h < 2.2
        along = np.array([1, 1, 1, 1, -1, -1, -1, -1]) * length / 2
        across = np.array([1, 1, -1, -1, 1, 1, -1, -1]) * w / 2
        down = np.array([0, -h] * 4)
        c, s = np.cos(turn), np.sin(turn)
        corners = np.stack([x + c * along + s * across, y + down, z - s * along + c * across, np.ones(8)])
        u, v, depth = projection @ corners
        u, v = u / depth, v / depth
        assert u.min() - 2 <= left
        assert right <= u.max() + 2
        assert v.min() - 4 <= top
        assert bottom <= v.max() + 4
        # The 3D box is no larger than a person with spread arms.
        assert v.max() - v.min() < 1.3 * (bottom - top) + 10 or row[3] != "0"


@pytest.mark.slow
def test_webdataset_reads_every_frame_with_its_maps(tmp_path: Path):
    webdataset: Any = pytest.importorskip("webdataset")
    plan = make_plan(["corridor"], ["stay"], [2], overrides=TINY)
    outs = [export(plan, tmp_path / name, "webdataset", maps=MAPS) for name in ("one", "two")]
    shards = (outs[0] / "shards.txt").read_text().split()
    assert [(outs[0] / one).read_bytes() for one in shards] == [(outs[1] / one).read_bytes() for one in shards]
    found = list(webdataset.WebDataset([str(outs[0] / one) for one in shards], shardshuffle=False))
    assert [one["__key__"] for one in found] == [f"{NAME}/{number:08d}" for number in range(1, 5)]
    with Simulation(load("corridor", TINY)) as simulation:
        frame = simulation.reset(2)
        for index, one in enumerate(found):
            image = cv2.imdecode(np.frombuffer(one["png"], np.uint8), cv2.IMREAD_COLOR)
            np.testing.assert_array_equal(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), frame.image)
            content = json.loads(one["json"])
            assert content["frame"] == index
            np.testing.assert_allclose(content["box"], frame.truth.box, atol=6e-6)
            assert {"depth.png", "masks.png"} <= set(one)
            assert ("flow.png" in one) == (index < 3)
            frame = simulation.advance() if index < 3 else frame


@pytest.mark.slow
def test_masks_under_every_effect_are_those_of_the_truth(tmp_path: Path):
    effects = {"axes.blur.severity": 2, "axes.rolling_shutter.severity": 2, "axes.distortion.severity": 1}
    plan = make_plan(["corridor"], ["stay"], [2], overrides={**TINY, **effects})
    out = export(plan, tmp_path / "out", "coco", maps=["masks"])
    masks = [decode_masks(content) for content in maps_of(out / "images" / NAME, "masks")]
    rows = duckdb.sql(
        f"SELECT frame, identity, visible_box FROM '{out}/images/{NAME}/truth.parquet' WHERE state = 'visible'"
    ).fetchall()
    assert len(rows) >= 4
    for frame, identity, box in rows:
        assert list(cv2.boundingRect((masks[frame] == identity).astype(np.uint8))) == list(box)


@pytest.mark.parametrize(
    ("layout", "maps", "words"),
    [("otb", ["depth"], "no depth under"), ("otb", ["flow", "masks"], "no flow under"), ("kitti", [], "no 3D boxes")],
)
@pytest.mark.parametrize("axis", ["blur", "rolling_shutter", "distortion"])
def test_what_has_no_definition_is_refused_before_anything_is_written(
    tmp_path: Path, layout: str, maps: list[str], words: str, axis: str
):
    plan = make_plan(["corridor"], ["stay"], [2], overrides={**TINY, f"axes.{axis}.severity": 1})
    with pytest.raises(ScenarioError, match=words):
        export(plan, tmp_path / "out", layout, maps=maps)
    assert not (tmp_path / "out").exists()


def test_a_wrong_map_is_named(tmp_path: Path):
    with pytest.raises(UnknownNameError, match="did you mean 'depth'"):
        export(make_plan(["corridor"], ["stay"], [2]), tmp_path / "out", "otb", maps=["dept"])


def test_maps_keep_what_they_can_hold():
    depth = np.array([[0.5, 255.9, 300.0, np.inf]])
    np.testing.assert_allclose(decode_depth(encode_depth(depth)), [[0.5, 255.9, np.inf, np.inf]], atol=1 / 512)
    flow = np.array([[[1.25, -3.5], [0.0, 0.0], [600.0, 0.0]]])
    decoded, known = decode_flow(encode_flow(flow, np.array([[True, False, True]])))
    assert known.tolist() == [[True, False, False]]
    np.testing.assert_array_equal(decoded[0, 0], flow[0, 0])
