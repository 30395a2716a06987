import ast
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pftrack_sim.core import compiled

CODE = """
from pftrack_sim.core import compiled

@compiled.kernel
def ratio(a, b):
    return a / b

ratio.py_func.__module__ = "pftrack_sim.test"
compiled._PATIENCE_S = -1.0
print(ratio(1.0, 0.0), ratio(1, 2))
"""


@pytest.mark.parametrize(
    ("before", "times"), [("", 1), pytest.param("compiled.compile_in_silence()\n", 0, marks=pytest.mark.slow)]
)
def test_a_kernel_divides_by_zero_and_says_once_that_it_compiles(tmp_path, before: str, times: int):
    (tmp_path / "code.py").write_text(CODE.replace("print(", f"{before}print("))
    done = subprocess.run([sys.executable, tmp_path / "code.py"], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["inf", "0.5"]
    assert done.stderr.count("compiling for this machine") == times


def test_kernels_take_what_they_are_made_of_from_their_own_file():
    """Numba keeps the machine code of a file until that file changes."""
    taken: list[str] = []
    for path in Path(compiled.__file__).parents[1].rglob("*.py"):
        tree = ast.parse(path.read_text())
        imported = {
            alias.asname or alias.name
            for node in tree.body
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("pftrack_sim.")
            for alias in node.names
        }
        for node in tree.body:
            marks = node.decorator_list if isinstance(node, ast.FunctionDef) else []
            if {getattr(one, "id", None) for one in marks} & {"kernel", "part_of_kernel"}:
                used = {one.id for one in ast.walk(ast.Module(node.body, [])) if isinstance(one, ast.Name)}
                taken += [f"{path.name}: {node.name} uses {name}" for name in sorted(used & imported)]
    assert not taken


WHOLE = """
import gymnasium as gym, numpy as np, sys
import pftrack_sim
from pftrack_sim import trackers

size = {"camera.width_px": 96, "camera.height_px": 72}
env = gym.make("pftrack_sim/Track-v0", scenario="easy/corridor", overrides=size)
observation, _ = env.reset(seed=1)
boxes = [observation["init_box"]]
for name in ("ko2012", "pftrack"):
    tracker = trackers.make(name)
    tracker.init(observation["image"], boxes[0])
    boxes.append(tracker.update(observation["image"]).box)
observation, _, _, _, info = env.step(boxes[0])
boxes.append(info["truth"].amodal_box)
np.save(sys.argv[1], boxes)
"""


@pytest.mark.slow
def test_everything_runs_without_the_compiler(tmp_path):
    code, found = tmp_path / "code.py", []
    code.write_text(WHOLE)
    for off in ("0", "1"):
        path = tmp_path / f"boxes-{off}.npy"
        subprocess.run([sys.executable, code, path], env={**os.environ, "NUMBA_DISABLE_JIT": off}, check=True)
        found.append(np.load(path))
    np.testing.assert_allclose(*found, atol=1e-3)
