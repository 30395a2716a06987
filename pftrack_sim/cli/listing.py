"""Lists of what there is: scenarios, suites, trackers, controllers and stress axes."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from rich.table import Table

from pftrack_sim.cli.tables import console
from pftrack_sim.core.errors import UnknownNameError


def print_names(what: str) -> None:
    """Print the names of scenarios, suites, trackers, controllers or stress axes with a description each."""
    listings: dict[str, Callable[[], Iterable[tuple[str, str]]]] = {
        "scenarios": _scenarios,
        "suites": _suites,
        "trackers": _trackers,
        "controllers": _controllers,
        "axes": _axes,
    }
    if what not in listings:
        raise UnknownNameError("listing", what, listings)
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    for name, description in listings[what]():
        table.add_row(name, description)
    console.print(table)


def _scenarios() -> Iterable[tuple[str, str]]:
    from pftrack_sim import scenario

    trees = {name: scenario.load(name).tree for name in scenario.names()}
    return [(name, f"{tree.get('tier', 'easy'):5} {tree['title']}") for name, tree in trees.items()]


def _suites() -> Iterable[tuple[str, str]]:
    from pftrack_sim.benchmark.asked.suite import load_suite, suite_names

    return [(name, load_suite(name).title) for name in suite_names()]


def _trackers() -> Iterable[tuple[str, str]]:
    from pftrack_sim import trackers

    return [(name, trackers.describe(name)) for name in trackers.names()]


def _controllers() -> Iterable[tuple[str, str]]:
    from pftrack_sim import controllers

    return [(name, controllers.describe(name)) for name in controllers.names()]


def _axes() -> Iterable[tuple[str, str]]:
    from pftrack_sim.scenario.axes import axes_by_name

    for name, axis in axes_by_name().items():
        typical = f"{axis(severity=1.0).physical:g} {axis.unit}"
        what = " ".join((axis.__doc__ or "").split())
        yield name, f"{what}\n  severity 1: {axis.headline} = {typical}\n  law: {axis.law}\n  source: {axis.source}"
