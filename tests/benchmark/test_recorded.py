"""Trackers on recorded sequences: scores, and the videos of them."""

from dataclasses import replace
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from pftrack_sim.benchmark import TrackerSpec
from pftrack_sim.benchmark.datasets.recorded import evaluate, video_paths
from pftrack_sim.core.errors import ParameterError, RunError, SequenceError, UnknownNameError
from pftrack_sim.formats import RecordedSequence
from pftrack_sim.formats.images import ImageFiles


def record(folder: Path, count: int = 6) -> RecordedSequence:
    """A white square that moves right over black; the fourth frame has no annotated box."""
    folder.mkdir()
    paths, truth = [], []
    for index in range(count):
        image = np.zeros((60, 80, 3), np.uint8)
        image[20:40, 10 + index : 30 + index] = 255
        paths.append(folder / f"{index}.png")
        cv2.imwrite(str(paths[-1]), image)
        truth.append([10.0 + index, 20, 20, 20] if index != 3 else [np.nan] * 4)
    return RecordedSequence(folder.name, ImageFiles(paths), np.array(truth))


def frames(path: Path) -> list[np.ndarray]:
    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]


def test_scores_of_the_oracle_and_of_a_fixed_box(tmp_path: Path):
    ticks: list[int] = []
    found = evaluate([record(tmp_path / "a")], ["oracle", "stay"], [0, 1], on_frame=lambda: ticks.append(1))
    assert [(one.tracker.name, one.seed) for one in found] == [("oracle", 0), ("stay", 0), ("oracle", 1), ("stay", 1)]
    assert len(ticks) == 6
    assert found[0].summary.frames == 4
    assert found[0].summary.mean_overlap == 1.0
    assert found[1].summary.mean_overlap == pytest.approx(np.mean([(20 - d) / (20 + d) for d in (1, 2, 4, 5)]))


def test_box_noise_changes_where_trackers_start_by_the_seed(tmp_path: Path):
    sequence, seeds = record(tmp_path / "a"), [0, 1, 2]
    still, noisy, again = (
        [one.summary.mean_overlap for one in evaluate([sequence], ["stay"], seeds, box_noise=share)]
        for share in (0.0, 0.1, 0.1)
    )
    assert len(set(still)) == 1
    assert len(set(noisy)) == 3
    assert noisy == again
    assert min(noisy) > 0.5
    assert evaluate([sequence], ["oracle"], [0], box_noise=0.1)[0].summary.mean_overlap == 1.0
    with pytest.raises(ParameterError, match=r"\[0, 0.5\], got 0.6"):
        evaluate([sequence], ["stay"], [0], box_noise=0.6)


def test_trackers_start_at_shares_of_a_sequence_and_are_scored_from_there(tmp_path: Path):
    sequence = record(tmp_path / "a")
    from_first, later = evaluate([sequence], ["stay"], [0], starts=[0.0, 0.5])
    truth = np.where(np.arange(6)[:, None] < 3, np.nan, sequence.truth)
    alone = evaluate([replace(sequence, truth=truth)], ["stay"], [0])
    assert (from_first.start, later.start) == (0.0, 0.5)
    assert later.summary.frames < from_first.summary.frames
    assert later.summary.mean_overlap == alone[0].summary.mean_overlap
    for start, words in ((1.0, r"\[-1, 1\), got 1"), (-0.5, "shown forward only")):
        with pytest.raises(ParameterError, match=words):
            evaluate([sequence], ["stay"], [0], starts=[start])


def test_a_video_shows_every_frame_with_the_truth_and_the_boxes(tmp_path: Path):
    sequence = record(tmp_path / "a")
    video = tmp_path / "new" / "a.mp4"
    evaluate([sequence], ["stay"], [0, 1], video=video)
    shown = frames(video)
    assert len(shown) == 6
    assert shown[0].shape == (60, 80, 3)
    grey = [np.abs(frame.astype(int) - 136).sum(axis=2)[30:38, 8:12].min() for frame in shown]
    # The codec does not give the same bits every time; black is at 408.
    assert max(grey) < 250, "the tracker's box stays where it began"


def test_particles_are_drawn_when_asked_for_and_change_no_score(tmp_path: Path):
    sequence = record(tmp_path / "a")
    scores, videos = [], []
    for wanted in (False, True):
        video = tmp_path / f"{wanted}.mp4"
        shown = TrackerSpec(name="ko2012", params={"particles": wanted})
        found = evaluate([sequence], [shown], [0], video=video)
        scores.append(found[0].summary.mean_overlap)
        videos.append(frames(video)[1].astype(int))
    assert scores[0] == scores[1]
    assert (np.abs(videos[1] - videos[0]).sum(axis=2) > 60).sum() > 20


def test_several_sequences_go_into_a_folder(tmp_path: Path):
    sequences = [record(tmp_path / "a"), record(tmp_path / "b", count=4)]
    evaluate(sequences, ["stay"], [0], video=tmp_path / "videos")
    assert [len(frames(tmp_path / "videos" / f"{name}.mp4")) for name in "ab"] == [6, 4]


def test_impossible_names_of_videos(tmp_path: Path):
    one, other = record(tmp_path / "a"), record(tmp_path / "b")
    assert video_paths([one], tmp_path / "x.mp4") == [tmp_path / "x.mp4"]
    with pytest.raises(ParameterError, match="give a folder instead of"):
        video_paths([one, other], tmp_path / "x.mp4")
    with pytest.raises(ParameterError, match="several sequences are called a:"):
        video_paths([one, other, one], tmp_path / "videos")
    with pytest.raises(RunError, match="neither a folder nor"):
        video_paths([one], Path(one.where(0)))


def test_a_wrong_name_leaves_nothing_behind(tmp_path: Path):
    sequence = record(tmp_path / "a")
    with pytest.raises(UnknownNameError):
        evaluate([sequence], ["stya"], [0], video=tmp_path / "videos")
    assert not (tmp_path / "videos").exists()


def test_images_of_two_sizes_are_refused_and_no_half_video_is_left(tmp_path: Path):
    sequence = record(tmp_path / "a")
    cv2.imwrite(sequence.where(4), np.zeros((30, 40, 3), np.uint8))
    with pytest.raises(SequenceError, match=r"4\.png: images of one sequence need one size, got 80 x 60 and 40 x 30"):
        evaluate([sequence], ["stay"], [0], video=tmp_path / "a.mp4")
    assert not list(tmp_path.glob("*.mp4*"))
