"""The vector environment: the bits of single environments, both autoresets, and no process left over."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from observing import TINY

import pftrack_sim  # noqa: F401 - registers the environments
from pftrack_sim.core.errors import CommandError, ParameterError, ScenarioError, UnknownNameError, WorkerError
from pftrack_sim.wrappers import BoxObservation

SMALL = {**TINY, "camera.rate_hz": 10, "duration_s": 0.3, "distractors.count": 0}


def make_vec(env_id: str = "Follow-v0", num_envs: int = 2, **more: Any) -> Any:
    more = {"scenario": "corridor", "overrides": SMALL, "image": False, **more}
    return gym.make_vec(f"pftrack_sim/{env_id}", num_envs, vectorization_mode="vector_entry_point", **more)


@pytest.mark.parametrize("mode", ["NextStep", pytest.param("SameStep", marks=pytest.mark.slow)])
def test_the_bits_are_those_of_single_environments(mode: str):
    envs = make_vec(autoreset_mode=mode)
    singles = [gym.make("pftrack_sim/Follow-v0", scenario="corridor", overrides=SMALL, image=False) for _ in range(2)]
    command = np.array([0.5, 0.2, -0.1, 0.0])
    observation, info = envs.reset(seed=7)
    expected = [single.reset(seed=7 + index) for index, single in enumerate(singles)]
    again = False
    for _ in range(7):
        for index, (seen, known) in enumerate(expected):
            for key, value in seen.items():
                np.testing.assert_array_equal(observation[key][index], value, err_msg=key)
            assert info["truth"][index] == known["truth"]
            assert info["seed"][index] == known["seed"]
        observation, reward, terminated, truncated, info = envs.step(np.stack([command, command]))
        expected = []
        for index, single in enumerate(singles):
            if again:
                expected.append(single.reset())
                continue
            seen, rewarded, _, over, known = single.step(command)
            assert reward[index] == rewarded
            assert truncated[index] == over
            if over and mode == "SameStep":
                np.testing.assert_array_equal(info["final_obs"][index]["proprio"], seen["proprio"])
                assert info["final_info"]["truth"][index] == known["truth"]
                seen, known = single.reset()
            expected.append((seen, known))
        again = bool(truncated[0]) and mode == "NextStep"
        assert not terminated.any()
    envs.close()


@pytest.mark.slow
def test_wrappers_run_in_the_processes():
    envs = make_vec(wrapper=BoxObservation)
    observation, _ = envs.reset(seed=[3, 4])
    assert observation.shape == (2, 10)
    assert (observation[:, 2:4] > 0.0).all()
    envs.close()
    assert not any(process.is_alive() for process in envs.processes)


@pytest.mark.slow
def test_images_come_through_shared_memory():
    envs = make_vec("Track-v0", image=True)
    single = gym.make("pftrack_sim/Track-v0", scenario="corridor", overrides=SMALL)
    np.testing.assert_array_equal(envs.reset(seed=3)[0]["image"][1], single.reset(seed=4)[0]["image"])
    single.close()
    envs.close()


def test_wrong_arguments_are_errors_before_a_process_starts():
    with pytest.raises(UnknownNameError, match="did you mean 'corridor'"):
        make_vec(scenario="coridor")
    with pytest.raises(ParameterError, match="NextStep"):
        make_vec(autoreset_mode="next")
    with pytest.raises(ParameterError, match="num_envs=0"):
        make_vec(num_envs=0)


@pytest.mark.slow
def test_a_program_without_its_guard_is_told_so(tmp_path: Path):
    program = tmp_path / "program.py"
    program.write_text("import gymnasium, pftrack_sim\ngymnasium.make_vec('pftrack_sim/Follow-v0', 1, image=False)\n")
    done = subprocess.run([sys.executable, program], capture_output=True, text=True, timeout=120)
    assert done.returncode == 1
    assert "must be below `if __name__ == '__main__':`" in done.stderr.splitlines()[-1]


@pytest.mark.slow
def test_an_error_in_one_environment_is_raised_as_it_was_and_ends_all():
    envs = make_vec(overrides={**SMALL, "camera.width_px": {"choice": [64, 96]}})
    assert [envs.env_fns[0]().scenario.resolve(seed).camera.width_px for seed in (0, 1, 3)] == [64, 64, 96]
    envs.reset(seed=[0, 1])
    with pytest.raises(ScenarioError, match="image size must not change"):
        envs.reset(seed=[0, 3])
    assert not any(process.is_alive() for process in envs.processes)
    envs = make_vec()
    envs.reset(seed=1)
    with pytest.raises(CommandError, match="finite"):
        envs.step(np.array([[0.0, 0.0, 0.0, 0.0], [np.nan, 0.0, 0.0, 0.0]]))
    envs.close()
    assert not any(process.is_alive() for process in envs.processes)


@pytest.mark.slow
def test_the_death_of_a_process_is_one_error_and_ends_the_others():
    envs = make_vec()
    envs.reset(seed=1)
    os.kill(envs.processes[0].pid, signal.SIGKILL)
    with pytest.raises(WorkerError, match="number 0 with exit code -9"):
        envs.step(np.zeros((2, 4)))
    assert not any(process.is_alive() for process in envs.processes)


@pytest.mark.slow
def test_an_answer_that_was_cut_in_the_middle_is_not_waited_for(monkeypatch: pytest.MonkeyPatch):
    envs = make_vec()
    envs.reset(seed=1)
    envs.step_async(np.zeros((2, 4)))

    def cut(timeout: float | None = None) -> bool:
        os.read(envs.parent_pipes[0].fileno(), 2)
        raise KeyboardInterrupt

    monkeypatch.setattr(envs, "_poll_pipe_envs", cut)
    with pytest.raises(KeyboardInterrupt):
        envs.step_wait()
    monkeypatch.undo()
    envs.close()
    assert not any(process.is_alive() for process in envs.processes)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_ctrl_c_leaves_no_process():
    code = (
        "import signal; import gymnasium as gym, numpy as np, pftrack_sim\n"
        "if __name__ == '__main__':\n"
        "    signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # a shell's background jobs ignore it
        "    envs = gym.make_vec('pftrack_sim/Follow-v0', 2, vectorization_mode='vector_entry_point', image=False,\n"
        f"        scenario='corridor', overrides={SMALL!r})\n"
        "    try:\n"
        "        envs.reset(seed=0)\n"
        "        print(*(one.pid for one in envs.processes), flush=True)\n"
        "        while True: envs.step(np.zeros((2, 4)))\n"
        "    finally:\n"
        "        envs.close()\n"
    )
    program = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                               text=True, start_new_session=True)  # fmt: skip
    assert program.stdout is not None
    pids = [int(word) for word in program.stdout.readline().split()]
    time.sleep(0.5)
    os.killpg(program.pid, signal.SIGINT)
    _, errors = program.communicate(timeout=240)
    assert errors.strip().endswith("KeyboardInterrupt")
    assert errors.count("Traceback") == 1
    assert len(pids) == 2
    assert not [pid for pid in pids if os.path.exists(f"/proc/{pid}")]
