"""A wrong word at the command line is answered by one message, and leaves nothing behind."""

import re
from pathlib import Path

import pytest

from tests.cli.test_cli import refused

WRONG = [
    (["bench", "corridor", "--trackers", "ko2012[particle_count=-5]", "--seeds", "0:5"], "particle_count: got -5"),
    (["bench", "plaza-wlk"], "did you mean 'plaza-walk'"),
    (["bench", "plaza-walk", "--trackers", "ko2021"], "did you mean 'ko2012'"),
    (["bench", "plaza-walk", "--trackers", "mytrk"], "package.module:factory"),
    (["bench", "plaza-walk", "--trackers", ","], "expected names"),
    (["bench", "plaza-walk", "--trackers", "trax:"], "a command must follow"),
    (["bench", "plaza-walk", "--log", "rerum"], "did you mean 'rerun'"),
    (["trax", "stay,ncc"], "trax serves one tracker"),
    (["studio", "nofile.mp4"], "nofile.mp4: no such file"),
    (["bench", "plaza-walk", "--preset", "papr"], "did you mean 'paper'"),
    (["bench", "plaza-walk", "--seeds", "x"], "seeds are written"),
    (["bench", "plaza-walk", "--axis", "jitter"], "--axis takes AXIS=LEVEL"),
    (["bench", "plaza-walk", "--axis", "jiter=1"], "did you mean 'jitter'"),
    (["bench", "plaza-walk", "--axis", "jitter.severty=1"], "did you mean 'severity'"),
    (["bench", "plaza-walk", "--trackers", "ko2012[paper]"], "parameters in brackets"),
    (["bench", "plaza-walk", "--trackers", "ko2012[particle_cont=3]"], "did you mean 'particle_count'"),
    (["bench", "plaza-walk", "--param", "alpha=0.1"], "--param needs --trackers"),
    (["follow", "plaza-walk", "--trackers", "ko2012", "--param", "ko2012.aplha=1"], "did you mean 'alpha'"),
    (["bench", "plaza-walk", "--trackers", "ncc", "--param", "preset=paper"], "the preset is no --param"),
    (["bench", "plaza-walk", "--trackers", "ncc", "--allow-truth", "nc"], "did you mean 'ncc'"),
    (["bench", "plaza-walk", "--trackers", "ncc[alpha=nan]"], "a finite number, a text, true, false"),
    (["follow", "plaza-walk", "--trackers", "my:make", "--param", "limits=[1.0, inf]"], "got limits=[1.0, inf]"),
    (["bench", "plaza-walk", "--cache", "--cache-gb", "0"], "limit must be > 0"),
    (["bench", "plaza-walk", "--part", "3/2"], "part must be K/N"),
    (["bench", "plaza-walk", "--progress", "loud"], "progress must be one of"),
    (["bench", "plaza-walk", "--isolation", "some"], "isolation must be one of"),
    (["bench", "plaza-walk", "--frame-limit-s", "0"], "time limit must be above 0"),
    (["bench", "plaza-walk", "--frame-limit-s", "inf"], "time limit must be above 0 and at most"),
    (["bench", "plaza-walk", "--memory-limit-mb", "1e300"], "memory limit 0 to 1e+09 MB"),
    (["bench", "plaza-walk", "--cache", "--cache-gb", "nan"], "--cache-gb must be 0 to 1e+06, got nan"),
    (["bench", "plaza-walk", "--starts", "9999999999999"], "10000"),
    (["bench", "plaza-walk", "--anchors", "9999999999999"], "10000"),
    (["bench", "plaza-walk", "--seeds", "5:5"], "seeds 5:5 are none"),
    (["bench", "plaza-walk", "--axis", "jitter=0,0"], "scenario given twice: plaza-walk jitter=0"),
    (
        ["bench", "plaza-walk", "--axis", "jitter=0,nan"],
        "levels of the axis jitter must be finite numbers, got 0.0, nan",
    ),
    (["bench", "plaza-walk", "--set", "camera=3"], "camera: got 3: input should be a table"),
    (["follow", "follow/plaza", "--latency", "oracle=20000"], "a latency must be 0 to 10000 ms, got 20000"),
    (["follow", "follow/plaza", "--axis", "latency=1e9"], "a latency must be 0 to 10000 ms, got 1e+09"),
    (["schema", "my.mp4"], "the schema is a .json file, got 'my.mp4'"),
    (["measure", "a.mp4", "--out", "a.mp4"], "--out is a .toml file, got 'a.mp4'"),
    (["measure", "a.toml", "--out", "./a.toml"], "--out is what is read, a.toml: name another file"),
    (["evaluate", "a.mp4", "--video", "./a.mp4"], "--video is what is read, a.mp4: name another file"),
    (["evaluate", "a.mp4", "--video", "b.xyz"], "--video is a .mp4 file, got 'b.xyz'"),
    (["check", "absent-folder"], "absent-folder is not a run folder"),
    (["check", str(Path(__file__))], "test_wrong_input.py is not a run folder: it has no run.json"),
    (["measure", "absent.mp4"], "absent.mp4: cannot be read: No such file or directory"),
    (["tables", "absent.md"], "absent.md cannot be read: No such file or directory"),
    (["query", "absent-folder", "SELECT 1"], "absent-folder is not a run folder"),
    (["merge", "out", "absent-folder"], "absent-folder is not a run folder"),
    (["bench", "plaza-walk", "--set", "camera.widthpx=3"], "did you mean 'width_px'"),
    (["bench", "plaza-walk", "--set", "duration_s=1e9"], "duration_s: got 1e+09"),
    (["bench", "plaza-walk", "--set", "jitter.angular_rms_deg=50"], "jitter.angular_rms_deg: got 50"),
    (["bench", "plaza-walk", "--set", "axes.jitter.ground_rms_deg=50"], "may shake by at most 40 deg"),
    (["bench", "plaza-walk", "--set", "duration_s=3", "--axis", "occlusion=0,1"], "axes.occlusion: has no effect"),
    (["bench", "plaza-walk", "--set", "camera"], "--set takes KEY=VALUE"),
    (["bench", "plaza-walk", "--videos", "some"], "videos must be one of"),
    (["bench", "plaza-walk", "--backend", "vulkan"], "egl"),
    (["bench", "plaza-walk", "--out", "/proc/nothing/here"], "/proc/nothing/here"),
    (["bench"], "scenarios"),
    (["bnch"], "bnch"),
    (["bench", "plaza-walk", "--sedes", "3"], "--seeds"),
    (["evaluate", "absent-folder"], "absent-folder"),
    (["evaluate", "absent-folder", "--seeds", "x"], "seeds are written"),
    (["evaluate", "absent-folder", "--param", "alpha"], "--param takes KEY=VALUE"),
    (["evaluate", "absent-folder", "--param", "ko2021.alpha=0.1"], "did you mean 'ko2012'"),
    (["render", "plaza-walk"], "--video"),
    (["render", "plaza-walk", "--video", "a.avi"], ".mp4"),
    (["render", "plaza-walk", "--video", "a.mp4", "--trackers", "ko2021"], "did you mean 'ko2012'"),
    (["render", "plaza-walk", "--video", "a.mp4", "--param", "particles=true"], "needs --trackers"),
    (["render", "plaza-walk", "--image", "a.png", "--at-s", "500"], "lasts"),
    (["export", "plaza-wlk", "--out", "a"], "did you mean 'plaza-walk'"),
    (["export", "plaza-walk", "--out", "a", "--format", "mott"], "did you mean 'mot'"),
    (["export", "plaza-walk"], "--out"),
    (["list", "trakers"], "did you mean 'trackers'"),
]


@pytest.mark.parametrize(
    ("arguments", "words"), WRONG, ids=lambda value: " ".join(value) if isinstance(value, list) else ""
)
def test_wrong_input_gives_one_clear_message_and_exit_code_2(arguments: list[str], words: str, tmp_path: Path):
    said = refused(*arguments, cwd=tmp_path)
    assert words in said
    assert not re.search(r"\d trackers?, \d", said), "said to have begun"
    assert not list(tmp_path.iterdir()), "something was left behind"
