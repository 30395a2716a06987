"""What the site takes from the package: help of the commands, spaces of the environments, scenarios and axes."""

import posixpath
import re
from pathlib import Path
from typing import Any

import gymnasium as gym
import PIL.Image
import results
import typer
from mkdocs.structure.files import File, Files

from pftrack_sim import scenario
from pftrack_sim.cli.app import app
from pftrack_sim.scenario.axes import axes_by_name

PICTURES = Path(__file__).parents[1] / "pictures"
WIDTH = 88
"""Of the help of commands, in characters: as many as a page shows."""

IMAGES = re.compile(r'<img [^>]*?src="([^"]+)"[^>]*>')
CODE = re.compile(r"<code.*?</code>", re.DOTALL)
OPTIONS = re.compile(r"(?<=[\s>\[(,])--[a-z][\w-]*")
TABLES = re.compile(
    r"^<!-- (?P<kind>tables|list) of (?P<name>.*?) -->\n(?P<body>.*?)<!-- end -->", re.MULTILINE | re.DOTALL
)
SPACES = re.compile(r"^<!-- spaces of (\S+) -->$", re.MULTILINE)


def on_files(files: Files, config: Any) -> Files:
    """Add the page of the command line."""
    files.append(File.generated(config, "cli.md", content=command_line()))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Write spaces, axes and scenarios where a page asks for them, and fold the tables of runs."""
    if page.parent is None:  # beside a page of its own tab there is nothing else to go to
        page.meta.setdefault("hide", ["navigation"])
    for kind, written in (("axes", axes), ("scenarios", scenarios)):
        mark = f"<!-- gallery of {kind} -->"
        markdown = markdown.replace(mark, written()) if mark in markdown else markdown
    return TABLES.sub(folded, SPACES.sub(lambda found: spaces(found[1]), markdown))


def folded(found: re.Match[str]) -> str:
    """The tables of a run behind a line that says what they show."""
    heads = re.findall(r"^\| (.*?) \|.*\n\| ---", found["body"], re.MULTILINE)
    if not heads and found["kind"] == "tables":  # not made yet
        return ""
    told = "; ".join(heads) if found["kind"] == "tables" else "What the columns mean"
    part = next((one for one in results.parts() if one.name == found["name"]), None)
    made_by = results.stale(part) if part is not None and found["kind"] == "tables" else []
    aged = f"Older than this version: made by {', '.join(made_by)}.\n\n" if made_by else ""
    return f'{aged}<details markdown="1"><summary>{told}</summary>\n\n{found["body"]}\n</details>'


def on_page_content(html: str, page: Any, **_: Any) -> str:
    """Say the size of every picture, so that nothing moves while it loads, and keep names of options in one line."""

    def sized(found: re.Match[str]) -> str:
        # Links are those of the site by now, where a page may be a folder of its own.
        path = PICTURES.parent / posixpath.normpath(posixpath.join(page.url, found[1]))
        if not path.is_relative_to(PICTURES):
            return found[0]
        if path.suffix == ".svg":
            box = re.search(r'viewBox="[-\d.]+ [-\d.]+ ([\d.]+) ([\d.]+)"', path.read_text(encoding="utf-8"))
            width, height = box.groups() if box else ("", "")
        else:
            with PIL.Image.open(path) as picture:
                width, height = str(picture.width), str(picture.height)
        return f'<img width="{width}" height="{height}"{found[0][4:]}'

    html = CODE.sub(lambda code: OPTIONS.sub(r'<span class="whole">\g<0></span>', code[0]), html)
    return IMAGES.sub(sized, html)


def command_line() -> str:
    """The help of every command."""
    group: Any = typer.main.get_command(app)
    pages = ["# Command line\n\n`pftrack-sim COMMAND --help` prints what stands here.\n"]
    context = group.context_class(group, info_name="pftrack-sim", terminal_width=WIDTH, max_content_width=WIDTH)
    for name, command in group.commands.items():
        below = command.context_class(
            command, info_name=name, parent=context, terminal_width=WIDTH, max_content_width=WIDTH
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
    rows.append(f"| render modes | {modes}; with `gym.make` also `rgb_array_list` |")
    rows.append("| arguments | [of all three](index.md) |")
    return "\n".join(rows)


def axes() -> str:
    """Every stress axis with its picture and its levels in its unit."""
    parts: list[str] = []
    for name, axis in axes_by_name().items():
        values = ", ".join(f"{axis(severity=level).physical:.3g}" for level in (0.0, 1.0, 2.0, 4.0))
        about = " ".join((axis.__doc__ or "").split("\n\n")[0].split())
        picture = f"![{name} at severity 0, 1, 2 and 4](pictures/axes/{name}.webp){{ loading=lazy }}\n\n"
        drawn = picture if (PICTURES / f"axes/{name}.webp").is_file() else ""  # detector: frames do not change
        parts.append(f"### {name}\n\n{about}\n\n{drawn}{values} {axis.unit}")
    return "\n\n".join(parts)


def scenarios() -> str:
    """A card for every scenario: its picture, name and title."""
    cards = [
        f'<figure markdown="span">\n![{name}](pictures/scenarios/{name.replace("/", "-")}.webp){{ loading=lazy }}\n'
        f"<figcaption><code>{name}</code> ({tree.get('tier', 'easy')}): {tree['title']}</figcaption>\n</figure>"
        for name, tree in ((name, scenario.load(name).tree) for name in scenario.names())
    ]
    return "\n\n".join(['<div class="gallery" markdown="1">', *cards, "</div>"])
