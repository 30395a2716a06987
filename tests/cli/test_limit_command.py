"""The command `limit`."""

import json
from pathlib import Path

import pytest

from tests.cli.test_cli import refused, succeeds
from tests.cli.test_examples import SMALL


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("corridor", "for example --axis jitter"),
        ("corridor --axis jiter", "did you mean 'jitter'"),
        ("corridor --axis jitter=1", "jitter=0.5:5"),
        ("corridor --axis jitter --axis jitter", "given twice"),
        ("corridor --axis jitter --width 10", "--width takes a percentage"),
        ("corridor --axis jitter --success always", "overlap >= 0.5 for 90 % of the episode"),
        ("corridor --axis jitter --controllers servo", "--controllers needs --follow"),
        ("ko2012 --axis jitter", "takes scenarios"),
        ("corridor --axis jitter --joint", "--joint takes two axes, got 1"),
        ("corridor --axis latency --trackers ncc", "only where the tracker drives"),
        ("corridor --axis jitter --measured none.toml", "none.toml: cannot be read as TOML"),
    ],
)
def test_a_wrong_input_is_one_line_and_exit_code_2(words: str, said: str, tmp_path: Path):
    message = refused("limit", *words.split(), cwd=tmp_path)
    assert said in message
    assert len(message.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_limits_are_printed_written_and_resumed(tmp_path: Path):
    line = "limit corridor --axis jitter=0.5:8 --trackers ncc,stay --budget 24 --workers 1 --out run"
    words = [*line.split(), *SMALL]
    first, second = (succeeds(*words, cwd=tmp_path) for _ in range(2))
    assert "Breaking points: overlap >= 0.5 for 90 % of the episode, in 50 % of the episodes" in first.stdout
    assert first.stdout == second.stdout
    assert first.stdout.splitlines()[-1] == "next: open run/limits.html"
    found = json.loads((tmp_path / "run/limits.json").read_text())
    assert [one["tracker"] for one in found["limits"]] == ["ncc", "stay"]
    assert (tmp_path / "run/limits.html").is_file()
    succeeds("check", "run", cwd=tmp_path)
