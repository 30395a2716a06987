"""The command that finds breaking points."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from pftrack_sim.cli import tables
from pftrack_sim.cli.options import RunOptions, with_run_options
from pftrack_sim.cli.progress import progress_bar, show_run
from pftrack_sim.cli.values import parse_names, parse_percent, parse_ranges
from pftrack_sim.core.errors import ParameterError

_SEEDS = "0:1000"
_WITHOUT = (
    *("axis", "box_noise", "starts", "anchors", "search", "search_seeds"),
    *("videos", "log", "part", "stop_on_error", "verbose"),
)


@partial(with_run_options, left_out=_WITHOUT)
def limit(
    scenarios: Annotated[list[str], typer.Argument(help="Scenarios: names or paths of TOML files.")],
    axis: Annotated[
        list[str] | None,
        typer.Option(
            "--axis",
            metavar="AXIS[=LOW:HIGH]",
            help="Stress axis, and the range of its levels in its unit; may be repeated: one limit each.",
        ),
    ] = None,
    success: Annotated[
        str | None,
        typer.Option(
            metavar="TEXT",
            help='MEASURE >= X for Y % of the episode; default: "overlap >= 0.5 for 90 % of the episode", or '
            '"followed to the end" with --follow.',
        ),
    ] = None,
    joint: Annotated[
        bool, typer.Option("--joint", help="Of two axes also what they break together: where one costs the other.")
    ] = False,
    at: Annotated[float, typer.Option(metavar="RATE", help="Success rate at the breaking point.")] = 0.5,
    width: Annotated[
        str, typer.Option(metavar="PERCENT", help="Length of the interval at which a search stops.")
    ] = "10%",
    budget: Annotated[int, typer.Option(metavar="N", help="Most episodes of a scenario and axis.")] = 200,
    follow: Annotated[bool, typer.Option("--follow", help="Closed loop: the trackers drive the robot.")] = False,
    controllers: Annotated[
        str | None,
        typer.Option("--controllers", "--controller", metavar="A,B", help="Of --follow; default: servo-avoid."),
    ] = None,
    measured: Annotated[
        Path | None,
        typer.Option(metavar="TOML", help="File that measure has written: print margins, breaking point / measured."),
    ] = None,
    videos: Annotated[bool, typer.Option(help="Film an episode just below and one just above each limit.")] = True,
    *,
    run: RunOptions,
) -> None:
    """Find how much of a stress axis trackers can take.

    The breaking point is the level at which a tracker succeeds in half of the episodes. Each level is chosen by what
    its outcome is expected to say, each episode has the next seed, and all trackers run in it.
    """
    from pftrack_sim.benchmark import RunStore, new_run_path
    from pftrack_sim.benchmark.asked.from_names import late_events
    from pftrack_sim.benchmark.asked.suite import is_suite
    from pftrack_sim.benchmark.limits.search import Wanted, examples, find_limits, first_plan, make_searches
    from pftrack_sim.benchmark.limits.success import parse_success
    from pftrack_sim.benchmark.running.filming import film
    from pftrack_sim.measuring.measured import read_levels
    from pftrack_sim.report.limits import limit_tables, write_limits_page

    suites = [name for name in scenarios if is_suite(name)]
    if suites:
        raise ParameterError(f"limit takes scenarios, and {suites[0]} is a suite")
    if controllers is not None and not follow:
        raise ParameterError("--controllers needs --follow: without it the robot follows its script")
    wanted = Wanted(
        parse_ranges(axis or []),
        parse_success(success, "follow" if follow else "open"),
        at,
        parse_percent(width, "--width"),
        budget,
        joint,
    )
    levels = read_levels(measured) if measured is not None else {}
    if measured is not None and not set(levels) & set(wanted.axes):
        asked = ", ".join(wanted.axes)
        raise ParameterError(f"{measured} has levels of {', '.join(levels)}, and --axis asks for {asked}")
    chosen = parse_names(controllers) if controllers is not None else None
    base = replace(run, seeds=run.seeds or _SEEDS).plan(scenarios, controllers=chosen, closed_loop=follow)
    searches = make_searches(base, wanted)
    plan = first_plan(base, searches)
    tables.print_warnings(late_events(plan, run.changed))
    path = run.out if run.out is not None else new_run_path(plan)
    most = sum(min(budget, len(one.seeds)) for one in searches)
    what = f"{len(searches)} search{'es' if searches[1:] else ''}, at most {most} episodes"
    with show_run(run.progress, path, what) as on_progress:
        found = find_limits(
            plan,
            searches,
            path,
            workers=run.workers,
            scheduler=run.scheduler,
            backend=run.backend,
            isolation=run.isolation,
            limits=run.limits,
            refresh=run.refresh,
            on_progress=on_progress,
        )
    tables.print_tables(*limit_tables(found, levels))
    if videos:
        with RunStore.begin(path, RunStore(path).plan) as store:
            shown = examples(store, found)
            with progress_bar("filming", len(shown)) as tick:
                film(store, shown, backend=run.backend, on_episode=tick)
            store.write_summary()
    tables.print_page(write_limits_page(path, found, levels))
    raise typer.Exit(1 if any(one.error for one in RunStore(path).results) else 0)
