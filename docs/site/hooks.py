"""What the site takes from the package: the help of every command, and the spaces of every environment."""

import re
from typing import Any

import gymnasium as gym
import typer
from mkdocs.structure.files import File, Files

import pftrack_sim  # noqa: F401 - registers the environments
from pftrack_sim.cli.app import app

SPACES = re.compile(r"^<!-- spaces of (\S+) -->$", re.MULTILINE)


def on_files(files: Files, config: Any) -> Files:
    """Add the page of the command line."""
    files.append(File.generated(config, "cli.md", content=command_line()))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Write the spaces of an environment where its page asks for them."""
    return SPACES.sub(lambda found: spaces(found[1]), markdown)


def command_line() -> str:
    """The help of every command."""
    group: Any = typer.main.get_command(app)
    pages = ["# Command line\n\n`pftrack-sim COMMAND --help` prints what stands here.\n"]
    context = group.context_class(group, info_name="pftrack-sim", terminal_width=100, max_content_width=100)
    for name, command in group.commands.items():
        below = command.context_class(
            command, info_name=name, parent=context, terminal_width=100, max_content_width=100
        )
        pages.append(f"## {name}\n\n```text\n{command.get_help(below).strip()}\n```\n")
    return "\n".join(pages)


def spaces(env_id: str) -> str:
    """A table of the spaces of an environment."""
    env = gym.make(env_id)
    rows = ["| | Space |", "| --- | --- |", f"| action | `{env.action_space}` |"]
    assert isinstance(env.observation_space, gym.spaces.Dict)
    for key, space in env.observation_space.items():
        shape = "" if isinstance(space, gym.spaces.Discrete) else f", shape {space.shape}, {space.dtype}"
        rows.append(f"| observation, `{key}` | {type(space).__name__}{shape} |")
    modes = ", ".join(f"`{mode}`" for mode in env.metadata["render_modes"])
    env.close()
    return "\n".join([*rows, f"| render modes | {modes}; with `gym.make` also `rgb_array_list` |"])
