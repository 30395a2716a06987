import subprocess
import sys

CODE = """
from pftrack_sim.core import compiled

@compiled.kernel
def ratio(a, b):
    return a / b

ratio.py_func.__module__ = "pftrack_sim.test"
compiled._PATIENCE_S = -1.0
print(ratio(1.0, 0.0), ratio(1, 2))
"""


def test_a_kernel_divides_by_zero_and_says_once_that_it_compiles(tmp_path):
    (tmp_path / "code.py").write_text(CODE)
    done = subprocess.run([sys.executable, tmp_path / "code.py"], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["inf", "0.5"]
    assert done.stderr.count("compiling for this machine") == 1
