"""The numbers of public toolkits beside ours, on exported data and on random boxes with every quirk.

got10k (also OTB's measures) and pycocotools come with the extra `toolkits`. TrackEval and the VOT toolkit ask for the
OpenCV wheel that excludes the headless one: `make test` installs them with `pip install --no-deps`.
"""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from pftrack_sim.benchmark import TrackerSpec, make_plan, run
from pftrack_sim.benchmark.datasets.export import export
from pftrack_sim.benchmark.datasets.results import export_results, score_results
from pftrack_sim.benchmark.kept.files import write_bytes
from pftrack_sim.core.boxes import pairwise_iou
from pftrack_sim.formats import LAYOUTS, Annotations, PersonBox
from pftrack_sim.formats.results import ResultFormat, TrackerResult, result_files
from pftrack_sim.score.multi_object import Tracks, multi_object
from pftrack_sim.score.protocols import from_anchors
from tests.benchmark.small import SMALL

pytestmark = pytest.mark.slow

TRACKERS = ("ko2012", "ncc", "pftrack")
SIZE = (96, 72)
COUNT = 30
FORMS: tuple[ResultFormat, ...] = ("otb", "got10k", "vot", "mot")
SOLID = (1.7, 0.5, 0.4, 0.0, 1.0, 4.0, 0.0)


@pytest.fixture(scope="module", params=["exported", "random"])
def folders(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """For every layout a data set and results of three trackers: `data-otb`, `results-otb`."""
    root = tmp_path_factory.mktemp(request.param)
    if request.param == "random":
        for form in FORMS:
            write_random(root / f"data-{form}", root / f"results-{form}", form)
        write_random(root / "data-kitti", None, "kitti")
        return root
    specs = [TrackerSpec(name=name) for name in TRACKERS]
    plan = make_plan(["corridor", "easy/plaza-walk"], specs, [1000, 1001], overrides={**SMALL, "duration_s": 1.5})
    finished = run(plan, root / "run", videos="none")
    for form in FORMS:
        export(plan, root / f"data-{form}", form)
        export_results(finished, root / f"results-{form}", form)
    export(plan, root / "data-kitti", "kitti", image="jpg")
    return root


def write_random(data: Path, results: Path | None, form: ResultFormat | Literal["kitti"]) -> None:
    """Boxes in and around the image, absent targets (not in OTB, whose scorers differ there), misses, exchanges."""
    layout, names = LAYOUTS[form], ["alpha", "beta", "gamma"]
    for place, name in enumerate(names):
        rng = np.random.default_rng(place)
        low = rng.uniform(0, 60, (COUNT, 2))
        boxes = np.column_stack([low, rng.uniform(6, np.array(SIZE) - low.clip(max=60))])
        if form != "otb":
            boxes[rng.choice(np.arange(2, COUNT), 4, replace=False)] = np.nan
        absent = np.isnan(boxes[:, 0])
        others = np.column_stack([rng.uniform(0, 50, (COUNT, 2)), rng.uniform(5, 20, (COUNT, 2))])
        rows = [[(1, box)] * (not gone) + [(2, other)] for box, gone, other in zip(boxes, absent, others, strict=True)]
        covered = range(4, COUNT, 9) if form in ("mot", "kitti") else ()
        people = tuple(
            tuple(
                PersonBox(identity, tuple(box.tolist()), 0.0 if frame in covered else 0.5, solid=SOLID)
                for identity, box in there
            )
            for frame, there in enumerate(rows)
        )
        folder = data / layout.sequences / name
        for number in range(COUNT):
            path = folder / f"{layout.image.format(number + layout.first)}.jpg"
            path.parent.mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(path), np.zeros((SIZE[1], SIZE[0], 3), np.uint8))
        layout.write(folder, Annotations(name, 10.0, SIZE, people))
        for tracker in TRACKERS if results is not None else ():
            estimates = np.where(absent[:, None], others, boxes) + rng.normal(0, 4, boxes.shape)
            estimates[:, 2:] = estimates[:, 2:].clip(0.5)
            # The tool takes a missing box for one at the corner of the image: no miss where that is precise.
            far = np.hypot(*(boxes[:, :2] + 0.5 * boxes[:, 2:]).T) > 30.0
            estimates[(rng.random(COUNT) < 0.15) & (far | (form != "otb"))] = np.nan
            estimates[0] = boxes[0]
            said = TrackerResult(estimates, np.full(COUNT, 3.0), np.full(COUNT, 0.7))
            for path, text in result_files(form, tracker, name, said):
                if form == "mot":  # a second track, and the first one changes its number
                    lines = [line.split(",") for line in text.splitlines()]
                    lines = [[line[0], "5" if int(line[0]) > 20 else "1", *line[2:]] for line in lines]
                    shifted = others + rng.normal(0, 2, others.shape) + [1, 1, 0, 0]
                    lines += [
                        [str(frame + 1), "2" if frame < 15 else "1" if frame > 24 else "5", *map(str, box), "1", "-1"]
                        for frame, box in enumerate(shifted.tolist())
                        if frame % 7 and not (15 <= frame <= 24 and frame > 19)
                    ]
                    unique = {(line[0], line[1]): line for line in lines}
                    text = "".join(",".join(line[:7]) + "\n" for line in unique.values())
                write_bytes(results / path, text.encode())
    for path, pieces in layout.index(data, names):
        write_bytes(data / path, "".join(pieces).encode())


def ours(folders: Path, form: str) -> dict[str, dict[str, float]]:
    found = score_results(folders / f"results-{form}", folders / f"data-{form}", layout=form).benchmark
    assert sorted(found) == sorted(TRACKERS)
    return found


def assert_equal(found: dict[str, dict[str, float]], theirs: dict[str, dict[str, float]]) -> None:
    for tracker, values in theirs.items():
        print(tracker, {name: (value, found[tracker][name]) for name, value in values.items()})  # noqa: T201
        assert {name: found[tracker][name] for name in values} == pytest.approx(values, abs=1e-12)


def test_got10k_computes_our_average_overlap_and_success_rates(folders: Path, tmp_path: Path):
    experiments = pytest.importorskip("got10k.experiments")
    tool: Any = experiments.ExperimentGOT10k(
        str(folders / "data-got10k"), "val", str(folders / "results-got10k"), str(tmp_path)
    )
    tool.plot_curves = lambda *_: None
    report = {name: values["overall"] for name, values in tool.report(list(TRACKERS)).items()}
    theirs = {
        name: {"ao": values["ao"], "sr_50": values["sr"], "sr_75": values["succ_curve"][75]}
        for name, values in report.items()
    }
    assert_equal(ours(folders, "got10k"), theirs)


def test_otb_success_and_precision_of_got10k_are_ours(folders: Path, tmp_path: Path):
    experiments = pytest.importorskip("got10k.experiments")
    datasets = pytest.importorskip("got10k.datasets")
    names = sorted(path.name for path in (folders / "data-otb").iterdir() if path.is_dir())
    versions = datasets.OTB._OTB__version_dict
    versions["ours"] = names  # the class knows only the names of OTB's own sequences
    tool: Any = object.__new__(experiments.ExperimentOTB)
    tool.dataset = datasets.OTB(str(folders / "data-otb"), "ours", download=False)
    tool.result_dir, tool.report_dir = str(folders / "results-otb"), str(tmp_path)
    tool.nbins_iou, tool.nbins_ce, tool.plot_curves = 21, 51, lambda *_: None
    report = {name: values["overall"] for name, values in tool.report(list(TRACKERS)).items()}
    theirs = {
        name: {
            "success": values["success_score"], "precision": values["precision_score"],
            "success_50": values["success_rate"],
        }
        for name, values in report.items()
    }  # fmt: skip
    assert_equal(ours(folders, "otb"), theirs)


def trackeval_scores(kind: str, results: Path, out: Path, asked: dict[str, Any]) -> dict[str, dict[str, float]]:
    """What TrackEval computes of every tracker in a kind of data set; skips the test where it is not installed."""
    trackeval: Any = pytest.importorskip("trackeval")
    quiet = {"PRINT_CONFIG": False}
    data = {"TRACKERS_FOLDER": str(results), "OUTPUT_FOLDER": str(out), **asked, **quiet}
    switched_off = ("PRINT_RESULTS", "PLOT_CURVES", "OUTPUT_SUMMARY", "OUTPUT_DETAILED", "TIME_PROGRESS")
    evaluator = trackeval.Evaluator({**quiet, **dict.fromkeys(switched_off, False), "USE_PARALLEL": False})
    metrics = trackeval.metrics
    measures = [metrics.HOTA(), metrics.CLEAR(quiet), metrics.Identity(quiet)]
    report, _ = evaluator.evaluate([getattr(trackeval.datasets, kind)(data)], measures)
    theirs = {}
    for name, values in report[kind].items():
        found = values["COMBINED_SEQ"]["pedestrian"]
        hota = {key.lower(): float(found["HOTA"][key].mean()) for key in ("HOTA", "DetA", "AssA")}
        clear = found["CLEAR"]
        counts = {"switches": clear["IDSW"], "missed": clear["CLR_FN"], "false_alarms": clear["CLR_FP"]}
        theirs[name] = {**hota, "idf1": found["Identity"]["IDF1"], "mota": clear["MOTA"], **counts}
    return theirs


def mot_challenge(dataset: Path) -> dict[str, str]:
    """How TrackEval is told of an export in the layout `mot`."""
    return {"GT_FOLDER": str(dataset), "BENCHMARK": "pftrack", "SPLIT_TO_EVAL": "train"}


def test_trackeval_computes_our_hota_idf1_and_mota(folders: Path, tmp_path: Path):
    asked = mot_challenge(folders / "data-mot")
    assert_equal(ours(folders, "mot"), trackeval_scores("MotChallenge2DBox", folders / "results-mot", tmp_path, asked))


def kitti_rules(truth: np.ndarray, estimates: np.ndarray) -> tuple[Tracks, Tracks]:
    """What KITTI scores, of one sequence: rows are frame, identity, x, y, w, h and, of the truth, occluded.

    A person of whom nothing shows is left out with the estimate matched to it; so is an unmatched one up to 25 px high.
    """
    kept = np.ones(len(estimates), dtype=bool)
    for frame in np.unique(estimates[:, 0]):
        there, here = truth[truth[:, 0] == frame], np.flatnonzero(estimates[:, 0] == frame)
        overlaps = np.array([pairwise_iou(estimates[here, 2:6], np.tile(one[2:6], (len(here), 1))) for one in there])
        overlaps = np.where(overlaps < 0.5, 0.0, overlaps).reshape(len(there), len(here))
        rows, columns = linear_sum_assignment(-overlaps)
        matched = {column: row for row, column in zip(rows, columns, strict=True) if overlaps[row, column] > 0.0}
        for place, index in enumerate(here):
            hidden = place in matched and there[matched[place], 6] == 3
            kept[index] = not hidden and (place in matched or estimates[index, 5] > 25.0)
    parts = (truth[truth[:, 6] < 3], estimates[kept])
    return tuple(Tracks(one[:, 0].astype(int), one[:, 1].astype(int), one[:, 2:6]) for one in parts)


def test_trackeval_reads_kitti_and_computes_our_hota_idf1_and_mota(folders: Path, tmp_path: Path):
    data, results = folders / "data-kitti", tmp_path / "results"
    pairs: dict[str, list[tuple[Tracks, Tracks]]] = {name: [] for name in TRACKERS}
    for labels in sorted((data / "label_02").iterdir()):
        lines = [line.split() for line in labels.read_text().splitlines()]
        truth = np.array([[float(line[column]) for column in (0, 1, 6, 7, 8, 9, 4)] for line in lines])
        truth[:, 4:6] -= truth[:, 2:4]
        for name in TRACKERS:
            said = folders / "results-mot/pftrack-train" / name / "data" / labels.name
            rows = np.loadtxt(said, delimiter=",", ndmin=2)[:, :6] - [1, 0, 1, 1, 0, 0]
            path = results / name / "data" / labels.name
            path.parent.mkdir(parents=True, exist_ok=True)
            corners = [f"{x!r} {y!r} {x + w!r} {y + h!r}" for x, y, w, h in rows[:, 2:].tolist()]
            path.write_text("".join(
                f"{frame:.0f} {identity:.0f} Pedestrian -1 -1 -10 {box} -1 -1 -1 -1000 -1000 -1000 -10 1\n"
                for (frame, identity), box in zip(rows[:, :2], corners, strict=True)
            ))  # fmt: skip
            pairs[name].append(kitti_rules(truth, rows))
    asked = {"GT_FOLDER": str(data), "CLASSES_TO_EVAL": ["pedestrian"]}
    theirs = trackeval_scores("Kitti2DBox", results, tmp_path / "out", asked)
    assert sorted(theirs) == sorted(TRACKERS)
    assert_equal({name: multi_object(pairs[name]) for name in TRACKERS}, theirs)


def average_precision(
    truth: dict[int, np.ndarray], found: list[tuple[int, float, np.ndarray]], overlap: float
) -> float:
    """Mean over 101 recalls of the best precision from there on; matches go to the most certain detection first."""
    taken: set[tuple[int, int]] = set()
    hits = []
    for image, _, box in sorted(found, key=lambda one: -one[1]):
        boxes = truth.get(image, np.empty((0, 4)))
        scores = pairwise_iou(np.tile(box, (len(boxes), 1)), boxes)
        scores[[place for place in range(len(boxes)) if (image, place) in taken]] = -1.0
        best = int(np.argmax(scores)) if len(scores) else -1
        hits.append(best >= 0 and scores[best] >= overlap)
        taken |= {(image, best)} if hits[-1] else set()
    right = np.cumsum(hits)
    precision = np.maximum.accumulate((right / np.arange(1, len(hits) + 1))[::-1])[::-1]
    recall = right / sum(map(len, truth.values()))
    places = np.searchsorted(recall, np.linspace(0, 1, 101) - 1e-12)
    return float(np.append(precision, 0.0)[np.minimum(places, len(precision))].mean())


def test_cocoeval_agrees_on_detections_and_gives_truth_itself_an_average_precision_of_1(tmp_path: Path):
    from pycocotools.coco import COCO
    from pycocotools.cocoeval import COCOeval

    crowd = {**SMALL, "distractors.count": 4, "duration_s": 1.0}
    data = export(make_plan(["plaza-walk"], ["stay"], [1000, 1001], overrides=crowd), tmp_path / "data", "coco")
    coco = COCO(str(data / "annotations/instances.json"))
    truth = {image: np.array([one["bbox"] for one in coco.imgToAnns[image]]).reshape(-1, 4) for image in coco.imgs}
    people = list(coco.anns.values())
    assert len(people) > 40

    def scored(kind: str, found: list[dict[str, Any]]) -> list[float]:
        judge = COCOeval(coco, coco.loadRes(found), kind)
        judge.evaluate()
        judge.accumulate()
        return judge.eval["precision"][:, :, 0, 0, 2].mean(axis=1).tolist()

    same = [{**{key: one[key] for key in ("image_id", "category_id", "bbox")}, "score": 0.5} for one in people]
    masks = [{**one, "segmentation": coco.annToRLE(person)} for one, person in zip(same, people, strict=True)]
    assert scored("bbox", same) == [1.0] * 10
    assert scored("segm", masks) == [1.0] * 10
    # An overlap of 0.72 is enough at thresholds of 0.5 to 0.7; beyond, some box fits another person behind.
    narrow = [{**one, "bbox": [*one["bbox"][:2], 0.72 * one["bbox"][2], one["bbox"][3]]} for one in same]
    assert scored("bbox", narrow)[:5] == [1.0] * 5
    assert max(scored("bbox", narrow)[5:]) < 0.01
    # Missed people, noise, false alarms, confidences; several detections of one person.
    rng = np.random.default_rng(0)
    rows = [(one["image_id"], one["bbox"]) for one in people if rng.random() < 0.9]
    rows += [rows[int(index)] for index in rng.integers(len(rows), size=20)]
    boxes = [(image, np.array(box) + 0.03 * np.tile(box[2:], 2) * rng.normal(size=4)) for image, box in rows]
    boxes += [(image, rng.uniform(5, 40, 4)) for image in coco.imgs for _ in range(2)]
    found = [(image, float(score), box) for (image, box), score in zip(boxes, rng.permutation(len(boxes)), strict=True)]
    theirs = scored("bbox", [
        {"image_id": image, "category_id": 1, "bbox": box.tolist(), "score": score} for image, score, box in found
    ])  # fmt: skip
    ours = [average_precision(truth, found, overlap) for overlap in np.arange(0.5, 0.96, 0.05)]
    assert 0.0 < theirs[-1] < theirs[0] < 1.0
    assert ours == pytest.approx(theirs, abs=1e-12)


def test_the_vot_toolkit_computes_our_accuracy_and_robustness(folders: Path):
    pytest.importorskip("vot")
    workspace = folders / "data-vot"
    (folders / "results-vot/results").rename(workspace / "results")
    tracker = "[{0}]\nlabel = {0}\nprotocol = trax\ncommand = pftrack-sim trax {0}\n"
    (workspace / "trackers.ini").write_text("\n".join(tracker.format(name) for name in TRACKERS))
    command = [sys.executable, "-m", "vot", "analysis", "--workspace", str(workspace), "--name", "found", *TRACKERS]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    (workspace / "results").rename(folders / "results-vot/results")
    assert done.returncode == 0, done.stderr
    report = json.loads((workspace / "analysis/found.json").read_text())
    accuracy, both = report["results"]["unsupervised"]["results"]
    theirs = {
        name: {"accuracy": accuracy[place][0], "tracked_accuracy": both[place][0], "robustness": both[place][1]}
        for place, name in enumerate(report["trackers"])
    }
    assert_equal(ours(folders, "vot"), theirs)


def test_expected_average_overlaps_are_those_of_the_vot_toolkit():
    theirs = pytest.importorskip("vot.analysis.multistart")
    rng = np.random.default_rng(0)
    walks = [np.cumsum(rng.normal(-0.03, 0.1, size)) + 0.7 for size in rng.integers(12, 60, 40)]
    runs = [np.clip(walk, 0.0, 1.0) for walk in walks]
    cut, whole = [], []
    for run_ in runs:
        low = [True, *(run_[1:] <= 0.1)]
        end = next((at for at in range(len(low) - 9) if all(low[at : at + 10])), len(low))
        cut.append(np.concatenate([run_[:end], np.zeros(len(low) - end)]))
        whole.append(end == len(low))
    assert 5 < sum(whole) < 35
    curve, _ = theirs.compute_eao_partial(cut, whole, 40)
    assert from_anchors([runs], (5, 40))["eao"] == pytest.approx(np.mean(curve[5:40]), abs=1e-12)
