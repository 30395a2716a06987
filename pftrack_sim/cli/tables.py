"""Results and tables on standard output."""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich import box
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table as RichTable

if TYPE_CHECKING:
    from pftrack_sim.benchmark import Plan, Result, RunStore
    from pftrack_sim.benchmark.datasets.recorded import RecordedResult
    from pftrack_sim.benchmark.reading.losses import LossShares
    from pftrack_sim.benchmark.said.comparison import RunComparison
    from pftrack_sim.report.tables import Table
    from pftrack_sim.score import Summary

# Longer lists are in the run folder.
_MOST_EPISODES, _MOST_LINES, _MOST_WORSE, _MOST_SLOW = 40, 20, 10, 3

_SLOW_MS = 1.0
"""Frames that took less are named nowhere."""

_LEAST_NAME = 10
"""Least width of a column of names [characters]."""

_WIDE = 100
"""Width of the terminal from which tables have more columns [characters]."""

_MOST_WIDE = 10_000

_FOLLOWING = {
    "success": "success",
    "collided": "collision",
    "tracked": "tracking_rate",
    "within": "within",
    "RMS m": "distance_rms_m",
    "losses": "losses",
}

_BRACKETS = re.compile(r" \(([-+.\d]+(?:(?: to |, )[-+.\d]+)+)\)$")
_SHARES = re.compile(r"\n([.\d]+) to ([.\d]+)$")

# Files and pipes have no width. No markup: brackets are those of `ko2012[alpha=0.5]`.
console = Console(highlight=False, markup=False, width=None if sys.stdout.isatty() else 200)


def print_bench(results: Sequence[Result]) -> None:
    """Print the overlap of each tracker in each episode and over all seeds, and how everybody in view was tracked."""
    from pftrack_sim.report.tables import grouped, people, row_name

    _print_episodes(results)
    groups = grouped(results, lambda one: (f"{one.scenario}, {one.condition.name}", one.label))
    named = {(place, row_name(label, own)): [one.measures for one in own] for (place, label), own in groups.items()}
    print_groups("frames in which the target is visible", named)
    _print_slowest((one.label, where(one), one.measures) for one in results)
    for table in people(results, ("HOTA", "IDF1", "MOTA", "switches")):
        print_table(table)
    _print_errors((one.label, where(one), one.error) for one in results if one.error)
    unseen = dict.fromkeys(where(one) for one in results if one.never_seen)
    print_lines(_first([f"the target is never visible, and nothing is scored, in {where}" for where in unseen]))


def _print_errors(errors: Iterable[tuple[str, str, str]]) -> None:
    """Print a line for each tracker and error, from labels, places and errors."""
    from pftrack_sim.report.tables import grouped

    lines = [
        f"{label} ended with an error on {own[0][1]}{f' and {len(own) - 1} more' if own[1:] else ''}, {error}"
        for (label, error), own in grouped(errors, lambda one: (one[0], one[2])).items()
    ]
    print_lines(_first(lines))


def _first(lines: Sequence[str]) -> list[str]:
    more = [f"and {len(lines) - _MOST_LINES} more"] if len(lines) > _MOST_LINES else []
    return [*lines[:_MOST_LINES], *more]


def where(one: Result) -> str:
    """Scenario, condition and seed of a result."""
    from pftrack_sim.report.tables import place_of

    return f"{place_of(one)} seed {one.seed}"


def _print_episodes(results: Sequence[Result]) -> None:
    from pftrack_sim.report.contents import by_episode
    from pftrack_sim.report.tables import Table, number_text

    trackers = list(dict.fromkeys(one.label for one in results))
    if len(results) > _MOST_EPISODES * len(trackers):
        return
    # Each tracker that drives has frames of its own.
    shared = [name for name in ("frames", "stay") if results[0].following is None and name not in trackers]
    rows: list[list[str]] = []
    for (scenario, condition, seed), own in by_episode(results).items():
        scored = {one.label: one for one in own}
        cells = [number_text(own[0].number(name), 0 if name == "frames" else 3) for name in shared]
        cells += [
            number_text(one.number("mean_overlap")) + (" !" if one.error else "") if one is not None else "-"
            for one in map(scored.get, trackers)
        ]
        rows.append([scenario, condition, str(seed), *cells])
    title = "Mean overlap per episode (frames in which the target is visible)"
    notes = {"!": "ended with an error; frames after it count as 0"} if any(one.error for one in results) else {}
    print_table(Table(title, ("scenario", "condition"), ("seed", *shared, *trackers), rows, notes, keys=1))


def print_run(plan: Plan, store: RunStore) -> None:
    """Print all results of a run: overlaps, axes, following, and each suite's table and claims beside its paper's."""
    from pftrack_sim.benchmark.reading.failures import failures
    from pftrack_sim.benchmark.said.claims import evaluate_claims
    from pftrack_sim.benchmark.said.readings import misread_trackers
    from pftrack_sim.report.tables import anchors, axes, causes, claim_text, following, paper_tables

    results = store.results
    print_warnings(misread_trackers(store))
    print_bench(results)
    said = (*axes(store), *anchors(store), *following(results, _FOLLOWING), *causes(failures(store).values()))
    for table in said:
        print_table(table)
    for suite in plan.suites:
        for table in paper_tables(suite, results):
            print_table(table)
        for claim in evaluate_claims(suite, results):
            parts = [f"  {claim_text(part)}: {part.verdict}" for part in claim.comparisons]
            print_lines([f"\n{claim.verdict.upper()} with preset {claim.preset}: {claim.statement}", *parts])


def print_standing(store: RunStore) -> None:
    """Print where the trackers of a run stand among the reference results of its frozen suites."""
    from pftrack_sim.benchmark.reference.standing import standings
    from pftrack_sim.report.standing import standing_remarks, standing_tables

    for found in standings(store):
        for table in standing_tables(found):
            print_table(table)
        print_lines(standing_remarks(found, shlex.quote(str(store.path))), wrap=True)


def print_comparison(found: RunComparison) -> None:
    """Print paired differences, what the seeds can show, and the episodes that lost most."""
    from pftrack_sim.report.comparison import remarks
    from pftrack_sim.report.tables import Table, number_text, p_text, range_text
    from pftrack_sim.score import INTERVALS, MEASURE_DEFINITIONS, VERDICTS

    first, second = found.titles
    rows = [
        [
            *(row.scenario, row.condition, str(row.difference.seeds), number_text(row.first), number_text(row.second)),
            *(range_text(row.difference, sign="+"), p_text(row.difference.p), row.verdict.replace("s ", "s\n", 1)),
        ]
        for row in found.rows
    ]
    title = f"{found.measure} of {second} minus that of {first}"
    heads = ("seeds", "first", "second", "difference", "p", "verdict")
    print_table(Table(title, ("scenario", "condition"), heads, rows))
    said = [f"Below each difference: {INTERVALS}.", f"{VERDICTS}."]
    said += [f"{found.measure}: {MEASURE_DEFINITIONS[found.measure]}", f"{found.statement}.", *remarks(found)]
    print_lines(said, wrap=True)
    worse = [
        [
            *(pair.first.scenario, pair.first.condition.name, str(pair.first.seed)),
            *(number_text(one.number(found.measure)) for one in (pair.first, pair.second)),
            f"{pair.difference:+.3f}",
        ]
        for pair in found.episodes
        if pair.difference < 0.0
    ][:_MOST_WORSE]
    if worse:
        title = f"Episodes that got worse, of {len(found.episodes)}"
        print_table(Table(title, ("scenario", "condition"), ("seed", "first", "second", "difference"), worse))


def print_losses(shares: Mapping[str, LossShares]) -> None:
    """Print how often each tracker lost the target, what happened then, and who never tracked it or failed."""
    from pftrack_sim.benchmark.reading.losses import LOSS, TAGS, tag_title
    from pftrack_sim.report.tables import Table

    rows: list[list[str]] = []
    for label, one in shares.items():
        if one.losses:
            rows.append([label, str(one.losses), *(f"{one.shares[tag]:.0%}" for tag in TAGS)])
            rows.append(["  of all frames", str(one.frame_count), *(f"{one.frames[tag]:.0%}" for tag in TAGS)])
    print_lines(f"{label} {one.statement}." for label, one in shares.items() if one.untracked or one.errors)
    if rows:
        heads = [tag_title(tag).replace(" ", "\n") for tag in TAGS]
        notes = {"loss": LOSS, **{tag_title(tag): words for tag, (words, _) in TAGS.items()}}
        print_table(Table("Share of the losses that begin with", ("tracker",), ("count", *heads), rows, notes))


def print_recorded(results: Sequence[RecordedResult]) -> None:
    """Print the scores of each tracker on each sequence, over all seeds."""
    from pftrack_sim.benchmark.datasets.recorded import misread_of
    from pftrack_sim.report.tables import grouped
    from pftrack_sim.score import mean_summary

    by_seed = grouped(results, lambda one: (one.sequence, one.tracker.label, one.seed))
    means = {key: mean_summary([one.summary for one in own]) for key, own in by_seed.items()}
    groups = {place: [means[key] for key in keys] for place, keys in grouped(means, lambda key: key[:2]).items()}
    starts = max(map(len, by_seed.values()), default=1)
    print_groups("frames with a known box" + (f", means of {starts} starts" if starts > 1 else ""), groups)
    _print_slowest((one.tracker.label, f"{one.sequence} seed {one.seed}", one.summary) for one in results)
    _print_errors((one.tracker.label, f"{one.sequence} seed {one.seed}", one.error) for one in results if one.error)
    print_warnings(misread_of(results))
    said = {one.tracker.label: f"\n{one.said}" for one in reversed(results) if one.said}
    print_lines(reversed(said.values()))


def _print_slowest(results: Iterable[tuple[str, str, Summary]]) -> None:
    """Print the slowest frames of the slowest trackers and where they were."""
    from pftrack_sim.report.tables import grouped

    slow = grouped((one for one in results if one[2].ms_max >= _SLOW_MS), lambda one: one[0])
    slowest = [max(own, key=lambda one: one[2].ms_max) for own in slow.values()]
    print_lines(
        f"slowest frame of {label}: {one.ms_max:.1f} ms, {where}, frame {one.ms_max_frame:.0f}"
        for label, where, one in sorted(slowest, key=lambda one: -one[2].ms_max)[:_MOST_SLOW]
    )


def print_groups(frames: str, groups: Mapping[tuple[str, str], Sequence[Summary]], unit: str = "seed") -> None:
    """Print means over seeds, or other units, by (place, tracker)."""
    from pftrack_sim.report.tables import summaries
    from pftrack_sim.score import INTERVALS

    print_table(summaries(frames, groups, unit, wide=console.width >= _WIDE))
    if max(map(len, groups.values()), default=0) > 1:
        print_lines([f"Below each overlap, a mean over {unit}s: {INTERVALS}."], wrap=True)


def print_table(table: Table) -> None:
    """Print a table, intervals below their means; columns that do not fit into the terminal follow in further parts."""
    console.print(f"\n{table.title}", soft_wrap=True)
    first, count = table.keys, len(table.numbers)
    while first < max(count, 1):
        ends = [end for end in range(first + 1, count + 1) if _least_width(_shown(table, first, end)) <= console.width]
        last = max(ends, default=first + 1)
        part = _shown(table, first, last)
        least = _least_width(part)
        if least > console.width:
            part.width = least
        console.print(part, soft_wrap=True)
        first = last
    print_lines((f"{name}: {words}" for name, words in table.definitions.items()), wrap=True)


def _shown(table: Table, first: int, last: int) -> RichTable:
    """The columns of names and keys of a table, and those of numbers from `first` to before `last`."""
    shown = RichTable(box=box.SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    for head in table.names[1:] if table.grouped else table.names:
        shown.add_column(head, overflow="fold", min_width=_LEAST_NAME)
    chosen = [*range(table.keys), *range(first, last)]
    for place in chosen:
        shown.add_column(table.numbers[place] if table.numbers else "", justify="right", no_wrap=True)
    place = None
    for row in table.rows:
        below = (_BRACKETS.sub(lambda found: "\n" + found[1].replace(", ", " "), cell) for cell in row)
        cells = [_SHARES.sub(r"\n\1-\2", cell) for cell in below]
        cells = [*cells[: len(table.names)], *(cells[len(table.names) + one] for one in chosen if table.numbers)]
        if table.grouped:
            if row[0] != place:
                shown.add_row(place := row[0])
            cells = [f"  {cells[1]}", *cells[2:]]
        shown.add_row(*cells)
    return shown


def _least_width(shown: RichTable) -> int:
    """Width of a table whose names are folded as far as they can be [characters]."""
    names = [column for column in shown.columns if not column.no_wrap]
    for column in names:
        column.max_width = _LEAST_NAME
    least = Measurement.get(console, console.options.update_width(_MOST_WIDE), shown).maximum
    for column in names:
        column.max_width = None
    return least


def print_folder(path: Path | None) -> None:
    """Print the path of the results."""
    console.print(f"written: {path}", soft_wrap=True)


def print_page(path: Path) -> None:
    """Print the path of a page, and how to see it."""
    print_folder(path)
    print_lines([f"next: open {shlex.quote(str(path))}"])


def print_next(run: RunStore) -> None:
    """Print what can be done with a run."""
    from pftrack_sim.score import LEAST_FOR_VERDICT

    path, labels = shlex.quote(str(run.path)), run.plan.labels
    steps = [f"open {path}/report.html"]
    if len(labels) > 1:
        steps.append(f"pftrack-sim compare {path} --trackers {shlex.quote(f'{labels[-1]},{labels[0]}')}")
    if len({one.seed for one in run.results}) < LEAST_FOR_VERDICT:
        steps.append(f"the same command with {LEAST_FOR_VERDICT} or more --seeds, as verdicts need, adds them")
    print_lines(["next: " + "\n      ".join(steps)])


def print_tracebacks(run: RunStore) -> None:
    """Print each tracker's first error with its traceback and what it printed, and where its picture is."""
    from pftrack_sim.report.tables import grouped

    for one, *_ in grouped((one for one in run.results if one.error), lambda one: one.label).values():
        picture = run.error_picture(one)
        if picture is not None:
            text = picture.with_suffix(".txt").read_text(encoding="utf-8")
            print_lines(["", text, f"picture of this frame, on {where(one)}: {picture}"])


def print_lines(lines: Iterable[str], *, wrap: bool = False) -> None:
    """Print lines: prose wraps between words, commands and paths stay whole to be copied."""
    for line in lines:
        console.print(line, soft_wrap=not wrap)


def print_warnings(lines: Sequence[str]) -> None:
    """Print warnings on standard error, one line each."""
    for line in _first(lines):
        print(f"pftrack-sim: warning: {line}", file=sys.stderr)  # noqa: T201
