"""Tables on standard output."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich import box
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table

if TYPE_CHECKING:
    from pftrack_sim.benchmark import Plan, Result, RunStore
    from pftrack_sim.benchmark.comparison import RunComparison
    from pftrack_sim.benchmark.losses import LossShares
    from pftrack_sim.benchmark.recorded import RecordedResult
    from pftrack_sim.score import Summary
    from pftrack_sim.score.following import Following

# Longer lists are in the run folder.
_MOST_EPISODES, _MOST_LINES, _MOST_WORSE = 40, 20, 10
_WANTED_DIFFERENCE = 0.02

_LEAST_NAME = 10
"""Least width of a column of names [characters]."""

_WIDE = 100
"""Width of the terminal from which tables have more columns [characters]."""

_MOST_WIDE = 10_000

_BESIDE_OVERLAP = ("stay", "skill", "success", "success_30", "centre_inside", "ceiling")

# Files and pipes have no width. No markup: brackets are those of `ko2012[alpha=0.5]`.
console = Console(highlight=False, markup=False, width=None if sys.stdout.isatty() else 200)


def print_bench(results: Sequence[Result]) -> None:
    """Print the overlap of each tracker in each episode, and over all seeds."""
    _print_episodes(results)
    groups: dict[tuple[str, str], list[Summary]] = {}
    for one in results:
        groups.setdefault((f"{one.scenario}, {one.condition.name}", one.label), []).append(one.measures)
    print_groups("frames in which the target is visible", groups)
    _print_people(results)
    errors = [f"{one.label} ended with an error on {_where(one)}, {one.error}" for one in results if one.error]
    unseen = dict.fromkeys(_where(one) for one in results if one.never_seen)
    for lines in (errors, [f"the target is never visible, and nothing is scored, in {where}" for where in unseen]):
        print_lines(lines[:_MOST_LINES])
        if len(lines) > _MOST_LINES:
            console.print(f"and {len(lines) - _MOST_LINES} more: see summary.parquet")


def _print_people(results: Sequence[Result]) -> None:
    """Print how everybody in view was tracked, by trackers of several people; nothing without one."""
    from pftrack_sim.score import PEOPLE_DEFINITIONS

    groups: dict[tuple[str, str, str], list[Result]] = {}
    for one in results:
        if not math.isnan(one.number("hota")):
            groups.setdefault((one.scenario, one.condition.name, one.label), []).append(one)
    if groups:
        heads = ("HOTA", "IDF1", "MOTA", "switches")
        table = new_table("Everybody in view (means over episodes)", ("scenario", "condition", "tracker"), heads)
        for names, found in groups.items():
            means = [float(np.mean([one.number(head.lower()) for one in found])) for head in heads]
            table.add_row(*names, *(_number(mean) for mean in means[:3]), f"{means[3]:.1f}")
        print_table(table)
        print_lines(f"{name}: {PEOPLE_DEFINITIONS[name]}" for name in heads)


def _where(one: Result) -> str:
    return " ".join([one.scenario, *([one.condition.name] if one.condition.name != "base" else []), f"seed {one.seed}"])


def _print_episodes(results: Sequence[Result]) -> None:
    trackers = list(dict.fromkeys(one.label for one in results))
    if len(results) > _MOST_EPISODES * len(trackers):
        return
    # Each tracker that drives has frames of its own.
    shared = ("frames", "stay", "ceiling") if results[0].following is None else ()
    by_episode = new_table(
        "Mean overlap per episode (frames in which the target is visible)",
        ("scenario", "condition"),
        ("seed", *shared, *trackers),
    )
    episodes: dict[tuple[str, str, int], dict[str, Result]] = {}
    for one in results:
        episodes.setdefault((one.scenario, one.condition.name, one.seed), {})[one.label] = one
    for (scenario, condition, seed), scored in episodes.items():
        first = next(iter(scored.values()))
        cells = [f"{first.number(name):.0f}" if name == "frames" else _number(first.number(name)) for name in shared]
        cells += [_number(scored[tracker].number("mean_overlap")) for tracker in trackers]
        by_episode.add_row(scenario, condition, str(seed), *cells)
    print_table(by_episode)


def print_suites(plan: Plan, results: Sequence[Result]) -> None:
    """Print the paper's table beside the results and the verdict on each claim, for every suite of a plan."""
    from pftrack_sim.benchmark.claims import compare_with_paper, evaluate_claims

    for suite in plan.suites:
        rows = compare_with_paper(suite, results)
        if suite.table is not None:
            heads = [name.rpartition("/")[2] for name in suite.table.columns]
            table = new_table(
                f"{suite.table.title}: printed / ours (95% interval over seeds)", ("tracker",), (*heads, "mean")
            )
            for row in rows:
                cells = [
                    f"{'-' if math.isnan(printed) else f'{printed:.1f}'} / {ours:.1f}\n{low:.1f}-{high:.1f}"
                    for printed, (ours, low, high) in zip(row.printed, row.ours, strict=True)
                ]
                table.add_row(row.tracker, *cells)
            print_table(table)
        for claim in evaluate_claims(suite, results):
            console.print(f"\n{claim.verdict.upper()}: {claim.statement}", soft_wrap=True)
            for part in claim.comparisons:
                console.print(
                    f"  {part.name}: {part.difference:+.3f} [{part.low:+.3f}, {part.high:+.3f}] "
                    f"over {part.seeds} seeds: {part.verdict}",
                    soft_wrap=True,
                )


def print_comparison(found: RunComparison) -> None:
    """Print paired differences, what the seeds can show, and the episodes that lost most."""
    from pftrack_sim.score import MEASURE_DEFINITIONS

    first, second = found.titles
    table = new_table(
        f"{found.measure} of {second} minus that of {first} (95% interval over seeds, p of the sign-flip test)",
        ("scenario", "condition"),
        ("seeds", "first", "second", "difference", "p", "verdict"),
    )
    for row in found.rows:
        ends = "" if math.isnan(row.low) else f"\n{row.low:+.3f} to {row.high:+.3f}"
        difference = "-" if math.isnan(row.difference) else f"{row.difference:+.3f}{ends}"
        cells = [
            str(row.seeds),
            _number(row.first),
            _number(row.second),
            difference,
            _number(row.p),
            row.verdict.replace("few ", "few\n"),
        ]
        table.add_row(row.scenario, row.condition, *cells)
    print_table(table)
    print_lines([f"{found.measure}: {MEASURE_DEFINITIONS[found.measure]}", f"{found.statement}."])
    last = found.rows[-1]
    if last.verdict == "too few seeds":
        console.print(
            f"With {last.seeds} seed{'s' if last.seeds != 1 else ''} the smallest possible p is {last.least_p:.2g}.",
            soft_wrap=True,
        )
    wanted = last.seeds_for(_WANTED_DIFFERENCE)
    if wanted is not None:
        console.print(
            f"To show a difference of {_WANTED_DIFFERENCE:g} in the last row (power 80%): {wanted} seeds.",
            soft_wrap=True,
        )
    if found.different_frames:
        console.print(
            f"{found.different_frames} of {len(found.episodes)} pairs did not see the same frames: the scenario, the "
            "drawing or the robot's way differs.",
            soft_wrap=True,
        )
    if found.unpaired:
        console.print(f"{found.unpaired} episodes are in one of the two only, and left out.", soft_wrap=True)
    _print_worse(found)


def _print_worse(found: RunComparison) -> None:
    """Print the episodes in which the second lost most, with the files to look at."""
    worse = [pair for pair in found.episodes if pair.difference < 0.0][:_MOST_WORSE]
    if not worse:
        return
    table = new_table(
        f"Episodes that got worse, of {len(found.episodes)}",
        ("scenario", "condition"),
        ("seed", "first", "second", "difference"),
    )
    for pair in worse:
        scores = [_number(one.number(found.measure)) for one in (pair.first, pair.second)]
        condition, seed = pair.first.condition.name, str(pair.first.seed)
        table.add_row(pair.first.scenario, condition, seed, *scores, f"{pair.difference:+.3f}")
    print_table(table)


def print_axes(store: RunStore) -> None:
    """Print scores over every axis with at least two levels, on the same frames at each."""
    from pftrack_sim.benchmark.degradation import TITLES, degradation, table_rows

    found = degradation(store).curves
    for measure, title in TITLES.items():
        rows = table_rows(found, measure)
        if rows:
            table = new_table(title, ("axis",), ("level", *rows[0].means))
            for row in rows:
                table.add_row(row.at.label, f"{row.at.x:g}", *(_number(mean) for mean in row.means.values()))
            print_table(table)


def print_losses(shares: Mapping[str, LossShares]) -> None:
    """Print how often each tracker lost the target and what happened then; nothing without a loss."""
    from pftrack_sim.benchmark.losses import LOSS, TAGS, tag_title

    lost = {label: one for label, one in shares.items() if one.losses}
    if not lost:
        return
    heads = [tag_title(tag).replace(" ", "\n") for tag in TAGS]
    table = new_table("Share of the losses that begin with", ("tracker",), ("losses", *heads))
    for label, one in lost.items():
        table.add_row(label, str(one.losses), *(f"{one.shares[tag]:.0%}" for tag in TAGS))
        table.add_row("  of all frames", "", *(f"{one.frames[tag]:.0%}" for tag in TAGS))
    print_table(table)
    print_lines([f"loss: {LOSS}", *(f"{tag_title(tag)}: {words}" for tag, (words, _) in TAGS.items())])


def print_follow(results: Sequence[Result]) -> None:
    """Print measures of following over all seeds; nothing for runs in open loop."""
    from pftrack_sim.score import FOLLOWING_DEFINITIONS

    groups: dict[tuple[str, ...], list[Following]] = {}
    for one in results:
        if one.following is not None:
            groups.setdefault((one.scenario, one.condition.name, one.label), []).append(one.following)
    if not groups:
        return
    counts = {len(driven) for driven in groups.values()}
    over = "all seeds" if len(counts) > 1 else f"{min(counts)} seed{'' if counts == {1} else 's'}"
    table = new_table(
        f"Following over {over} (95% intervals: Wilson's for success and collided, else the mean's bootstrap)",
        ("tracker+controller",),
        (*(["seeds"] if len(counts) > 1 else []), "success", "collided", "tracked", "within", "RMS m", "losses"),
    )
    previous = ""
    for (scenario, condition, label), driven in groups.items():
        place = f"{scenario}, {condition}"
        if place != previous:
            table.add_row(place)
            previous = place
        shares = [_ranged([getattr(one, key) for one in driven], share=True) for key in ("success", "collision")]
        means = [_ranged([getattr(one, key) for one in driven]) for key in ("tracking_rate", "within")]
        metres = _ranged([one.distance_rms_m for one in driven])
        lost = f"{_mean([float(one.losses) for one in driven]):.1f}"
        count = [str(len(driven))] if len(counts) > 1 else []
        table.add_row(f"  {label}", *count, *shares, *means, metres, lost)
    print_table(table)
    print_lines(f"{name}: {words}" for name, words in FOLLOWING_DEFINITIONS.items())


def _ranged(values: Sequence[float], *, share: bool = False) -> str:
    """A mean with its interval below."""
    from pftrack_sim.score import bootstrap_interval, proportion_interval

    low, high = proportion_interval(values) if share else bootstrap_interval(values, np.random.default_rng(0))
    mean = _mean(values)
    text = "-" if math.isnan(mean) else f"{mean:.2f}"
    return text if math.isnan(low) else f"{text}\n{low:.2f}-{high:.2f}"


def print_recorded(results: Sequence[RecordedResult]) -> None:
    """Print the scores of each tracker on each sequence, over all seeds."""
    groups: dict[tuple[str, str], list[Summary]] = {}
    for one in results:
        groups.setdefault((one.sequence, one.tracker.label), []).append(one.summary)
    print_groups("frames with a known box", groups)
    for one in results:
        if one.error:
            console.print(f"{one.tracker.label} ended with an error on {one.sequence} seed {one.seed}, {one.error}")
    first: dict[str, str] = {}
    for one in results:
        if one.said:
            first.setdefault(one.tracker.label, f"\n{one.said}")
    print_lines(first.values())


def print_groups(frames: str, groups: dict[tuple[str, str], list[Summary]], unit: str = "seed") -> None:
    """Print means over seeds, or other units, by (where, tracker), under a line for each place if there are several."""
    from pftrack_sim.score import DEFINITIONS, bootstrap_interval, mean_summary

    places = dict.fromkeys(where for where, _ in groups)
    seeds = {len(summaries) for summaries in groups.values()}
    where = f" in {next(iter(places))}" if len(places) == 1 and any(places) else ""
    count = f" {min(seeds)}" if len(seeds) == 1 else ""
    heads = ["mean\noverlap", "stay", "skill", "tracked\n>= 0.5", "\n>= 0.3", "centre\ninside", "ceiling"]
    heads += ["precision\n@ 20 px"] if console.width >= _WIDE else []
    title = f"Over{count or ' all'} {unit}{'' if count == ' 1' else 's'}{where} ({frames})"
    table = new_table(title, ("tracker",), (*([] if count else [f"{unit}s"]), *heads, "ms"))
    previous = "" if len(places) > 1 else next(iter(places), "")
    for (place, label), summaries in groups.items():
        if place != previous:
            table.add_row(place)
            previous = place
        mean = mean_summary(summaries)
        # The same random stream for every cell: an interval does not depend on the other rows.
        low, high = bootstrap_interval([one.mean_overlap for one in summaries], np.random.default_rng(0))
        cells = [_number(mean.mean_overlap) + ("" if math.isnan(low) else f"\n{low:.2f}-{high:.2f}")]
        cells += [_number(getattr(mean, name)) for name in _BESIDE_OVERLAP]
        cells += [_number(mean.precision)] if console.width >= _WIDE else []
        took = [one.ms_median for one in summaries if not math.isnan(one.ms_median)]
        ms = f"{float(np.median(took)):.2f}" if took else "-"
        indent = "  " if len(places) > 1 else ""
        table.add_row(indent + label, *([] if count else [str(len(summaries))]), *cells, ms)
    print_table(table)
    print_lines(f"{name}: {words}" for name, words in DEFINITIONS.items())
    if max(seeds, default=0) > 1:
        console.print(f"Below each overlap: the 95% bootstrap interval of its mean over {unit}s.", soft_wrap=True)


def new_table(title: str, names: Sequence[str], numbers: Sequence[str]) -> Table:
    """Print the title and return an empty table: names on the left, numbers on the right."""
    console.print(f"\n{title}", soft_wrap=True)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    for head in names:
        table.add_column(head, overflow="fold", min_width=_LEAST_NAME)
    for head in numbers:
        table.add_column(head, justify="right", no_wrap=True)
    return table


def print_table(table: Table) -> None:
    """Print a table; one whose numbers do not fit into the terminal is printed whole, wider than that."""
    names = [column for column in table.columns if not column.no_wrap]
    for column in names:
        column.max_width = _LEAST_NAME
    least = Measurement.get(console, console.options.update_width(_MOST_WIDE), table).maximum
    for column in names:
        column.max_width = None
    if least > console.width:
        table.width = least
    console.print(table, soft_wrap=True)


def print_folder(path: Path | None) -> None:
    """Print the path of the results."""
    console.print(f"written: {path}", soft_wrap=True)


def print_tracebacks(run: RunStore) -> None:
    """Print each tracker's first error with its traceback and what it printed, and where its picture is."""
    from pftrack_sim.benchmark.kept.error_files import error_picture

    first: dict[str, Result] = {}
    for one in run.results:
        if one.error:
            first.setdefault(one.label, one)
    for one in first.values():
        picture = error_picture(run.path, one, run.plan.labels)
        if picture is not None:
            text = picture.with_suffix(".txt").read_text(encoding="utf-8")
            print_lines(["", text, f"picture of this frame, on {_where(one)}: {picture}"])


def print_lines(lines: Iterable[str]) -> None:
    """Print lines without wrapping."""
    for line in lines:
        console.print(line, soft_wrap=True)


def print_warnings(lines: Sequence[str]) -> None:
    """Print warnings on standard error, one line each."""
    more = [f"and {len(lines) - _MOST_LINES} more"] if len(lines) > _MOST_LINES else []
    for line in [*lines[:_MOST_LINES], *more]:
        print(f"pftrack-sim: warning: {line}", file=sys.stderr)  # noqa: T201


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if not math.isnan(value)]
    return sum(known) / len(known) if known else math.nan


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.3f}"
