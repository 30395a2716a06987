"""The numbers of public toolkits beside ours, on exported data and on random boxes with every quirk.

got10k (also OTB's measures) comes with the extra `toolkits`. TrackEval and the VOT toolkit ask for the OpenCV wheel
that excludes the headless one: their tests run where they are installed with `pip install --no-deps`.
"""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from pftrack_sim.benchmark import TrackerSpec, make_plan, run
from pftrack_sim.benchmark.export import export
from pftrack_sim.benchmark.files import write_bytes
from pftrack_sim.benchmark.results import export_results, score_results
from pftrack_sim.formats import LAYOUTS, Annotations, PersonBox
from pftrack_sim.formats.results import ResultFormat, TrackerResult, result_files
from tests.benchmark.small import SMALL

pytestmark = pytest.mark.slow

TRACKERS = ("ko2012", "ncc", "pftrack")
SIZE = (96, 72)
COUNT = 30
FORMS: tuple[ResultFormat, ...] = ("otb", "got10k", "vot", "mot")


@pytest.fixture(scope="module", params=["exported", "random"])
def folders(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """For every layout a data set and results of three trackers: `data-otb`, `results-otb`."""
    root = tmp_path_factory.mktemp(request.param)
    if request.param == "random":
        for form in FORMS:
            write_random(root / f"data-{form}", root / f"results-{form}", form)
        return root
    specs = [TrackerSpec(name=name) for name in TRACKERS]
    plan = make_plan(["corridor", "easy/plaza-walk"], specs, [1000, 1001], overrides={**SMALL, "duration_s": 1.5})
    finished = run(plan, root / "run", videos="none")
    for form in FORMS:
        export(plan, root / f"data-{form}", form, image="jpg")
        export_results(finished, root / f"results-{form}", form)
    return root


def write_random(data: Path, results: Path, form: ResultFormat) -> None:
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
        people = tuple(
            tuple(PersonBox(identity, tuple(box.tolist()), 0.5) for identity, box in frame) for frame in rows
        )
        folder = data / layout.sequences / name
        for number in range(COUNT):
            path = folder / f"{layout.image.format(number + 1)}.jpg"
            path.parent.mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(path), np.zeros((SIZE[1], SIZE[0], 3), np.uint8))
        visible = np.where(absent, 0.0, 0.5)
        layout.write(folder, Annotations(name, 10.0, SIZE, boxes, visible, 0.0 * visible, absent, people))
        for tracker in TRACKERS:
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


def trackeval_scores(dataset: Path, results: Path, out: Path) -> dict[str, dict[str, float]]:
    """What TrackEval computes of every tracker; skips the test where it is not installed."""
    trackeval: Any = pytest.importorskip("trackeval")
    quiet = {"PRINT_CONFIG": False}
    data = {
        "GT_FOLDER": str(dataset), "TRACKERS_FOLDER": str(results), "OUTPUT_FOLDER": str(out),
        "BENCHMARK": "pftrack", "SPLIT_TO_EVAL": "train", **quiet,
    }  # fmt: skip
    switched_off = ("PRINT_RESULTS", "PLOT_CURVES", "OUTPUT_SUMMARY", "OUTPUT_DETAILED", "TIME_PROGRESS")
    evaluator = trackeval.Evaluator({**quiet, **dict.fromkeys(switched_off, False), "USE_PARALLEL": False})
    metrics = trackeval.metrics
    asked = [metrics.HOTA(), metrics.CLEAR(quiet), metrics.Identity(quiet)]
    report, _ = evaluator.evaluate([trackeval.datasets.MotChallenge2DBox(data)], asked)
    theirs = {}
    for name, values in report["MotChallenge2DBox"].items():
        found = values["COMBINED_SEQ"]["pedestrian"]
        hota = {key.lower(): float(found["HOTA"][key].mean()) for key in ("HOTA", "DetA", "AssA")}
        clear = found["CLEAR"]
        counts = {"switches": clear["IDSW"], "missed": clear["CLR_FN"], "false_alarms": clear["CLR_FP"]}
        theirs[name] = {**hota, "idf1": found["Identity"]["IDF1"], "mota": clear["MOTA"], **counts}
    return theirs


def test_trackeval_computes_our_hota_idf1_and_mota(folders: Path, tmp_path: Path):
    assert_equal(ours(folders, "mot"), trackeval_scores(folders / "data-mot", folders / "results-mot", tmp_path))


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
