import json

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from pftrack_sim.benchmark.said.profiling import profile_sequence
from pftrack_sim.cli.app import app
from pftrack_sim.core.errors import PftrackError
from pftrack_sim.formats import read_sequence
from pftrack_sim.score.profile import NUMBERS
from tests.benchmark.small import settings
from tests.cli.test_cli import sequence

SMALL = {"camera.width_px": 64, "camera.height_px": 48, "duration_s": 0.2, "lights.shadows": False}


@pytest.fixture
def moving(tmp_path):
    return sequence(tmp_path / "moving")


def test_a_sequence_is_measured_from_its_annotation(moving):
    found = profile_sequence(read_sequence(moving))
    assert found.step_median_per_s == pytest.approx(25.0 / np.sqrt(24 * 30))


@pytest.mark.filterwarnings("error")
def test_the_command_prints_and_plots(moving, tmp_path):
    out = tmp_path / "out"
    result = CliRunner().invoke(
        app, ["profile", "plaza-walk", str(moving), "--seeds", "0", *settings(SMALL), "--out", str(out)]
    )
    assert result.exit_code == 0, result.output
    written = json.loads((out / "profile.json").read_text())
    assert list(written) == ["plaza-walk", "moving"]
    assert list(written["moving"]) == list(NUMBERS)
    image = cv2.imread(str(out / "profile.png"))
    assert image.shape[0] > 500
    assert image.std() > 10


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["plaza-wlak"], "did you mean 'plaza-walk'"),
        (["plaza-walk", "plaza-walk"], "given twice"),
        (["{empty}"], "not a sequence"),
    ],
)
def test_wrong_names_are_reported(names, message, tmp_path):
    result = CliRunner().invoke(app, ["profile", *(name.format(empty=tmp_path) for name in names)])
    assert isinstance(result.exception, PftrackError)
    assert message in str(result.exception)
