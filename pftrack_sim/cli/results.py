"""Results on standard output: of runs, comparisons, recorded sequences and scored files."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping, Sequence

from pftrack_sim.benchmark import Plan, Result, RunStore
from pftrack_sim.benchmark.datasets.recorded import RecordedResult, misread_of
from pftrack_sim.benchmark.datasets.results import Scored
from pftrack_sim.benchmark.reading.failures import failures
from pftrack_sim.benchmark.reading.losses import LOSS, TAGS, LossShares, tag_title
from pftrack_sim.benchmark.reference.standing import standings
from pftrack_sim.benchmark.said.claims import evaluate_claims
from pftrack_sim.benchmark.said.comparison import RunComparison
from pftrack_sim.benchmark.said.readings import misread_trackers
from pftrack_sim.cli import tables
from pftrack_sim.cli.tables import first_lines, print_lines, print_tables, print_warnings
from pftrack_sim.report.comparison import remarks
from pftrack_sim.report.contents import by_episode
from pftrack_sim.report.standing import standing_remarks, standing_tables
from pftrack_sim.report.tables import (
    Table,
    anchors,
    axes,
    benchmark_table,
    causes,
    claim_text,
    following,
    grouped,
    number_text,
    p_text,
    paper_tables,
    people,
    place_of,
    range_text,
    row_name,
    summaries,
)
from pftrack_sim.score import INTERVALS, LEAST_FOR_VERDICT, MEASURE_DEFINITIONS, VERDICTS, Summary, mean_summary

# Longer lists are in the run folder.
_MOST_EPISODES, _MOST_SEQUENCES, _MOST_WORSE, _MOST_SLOW = 40, 40, 10, 3

_SLOW_MS = 1.0
"""Frames that took less are named nowhere."""

_WIDE = 100
"""Width of the terminal from which tables have more columns [characters]."""

_FOLLOWING = {
    "success": "success",
    "collided": "collision",
    "tracked": "tracking_rate",
    "within": "within",
    "RMS m": "distance_rms_m",
    "losses": "losses",
}


def print_run(plan: Plan, store: RunStore) -> None:
    """Print all results of a run: overlaps, axes, following, and each suite's table and claims beside its paper's."""
    results = store.results
    print_warnings(misread_trackers(store))
    print_bench(results)
    print_tables(*axes(store), *anchors(store), *following(results, _FOLLOWING), *causes(failures(store).values()))
    for suite in plan.suites:
        print_tables(*paper_tables(suite, results))
        for claim in evaluate_claims(suite, results):
            parts = [f"  {claim_text(part)}: {part.verdict}" for part in claim.comparisons]
            print_lines([f"\n{claim.verdict.upper()} with preset {claim.preset}: {claim.statement}", *parts])


def print_bench(results: Sequence[Result]) -> None:
    """Print the overlap of each tracker in each episode and over all seeds, and how everybody in view was tracked."""
    _print_episodes(results)
    groups = grouped(results, lambda one: (f"{one.scenario}, {one.condition.name}", one.label))
    named = {(place, row_name(label, own)): [one.measures for one in own] for (place, label), own in groups.items()}
    print_groups("frames in which the target is visible", named)
    _print_slowest((one.label, where(one), one.measures) for one in results)
    print_tables(*people(results, ("HOTA", "IDF1", "MOTA", "switches")))
    _print_errors((one.label, where(one), one.error) for one in results if one.error)
    unseen = dict.fromkeys(where(one) for one in results if one.never_seen)
    print_lines(first_lines([f"the target is never visible, and nothing is scored, in {where}" for where in unseen]))


def _print_episodes(results: Sequence[Result]) -> None:
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
    print_tables(Table(title, ("scenario", "condition"), ("seed", *shared, *trackers), rows, notes, keys=1))


def _print_errors(errors: Iterable[tuple[str, str, str]]) -> None:
    """Print a line for each tracker and error, from labels, places and errors."""
    lines = [
        f"{label} ended with an error on {own[0][1]}{f' and {len(own) - 1} more' if own[1:] else ''}, {error}"
        for (label, error), own in grouped(errors, lambda one: (one[0], one[2])).items()
    ]
    print_lines(first_lines(lines))


def where(one: Result) -> str:
    """Scenario, condition and seed of a result."""
    return f"{place_of(one)} seed {one.seed}"


def print_standing(store: RunStore) -> None:
    """Print where the trackers of a run stand among the reference results of its frozen suites."""
    for found in standings(store):
        print_tables(*standing_tables(found))
        print_lines(standing_remarks(found, shlex.quote(str(store.path))), wrap=True)


def print_comparison(found: RunComparison) -> None:
    """Print paired differences, what the seeds can show, and the episodes that lost most."""
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
    print_tables(Table(title, ("scenario", "condition"), heads, rows))
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
        print_tables(Table(title, ("scenario", "condition"), ("seed", "first", "second", "difference"), worse))


def print_losses(shares: Mapping[str, LossShares]) -> None:
    """Print how often each tracker lost the target, what happened then, and who never tracked it or failed."""
    rows: list[list[str]] = []
    for label, one in shares.items():
        if one.losses:
            rows.append([label, str(one.losses), *(f"{one.shares[tag]:.0%}" for tag in TAGS)])
            rows.append(["  of all frames", str(one.frame_count), *(f"{one.frames[tag]:.0%}" for tag in TAGS)])
    print_lines(f"{label} {one.statement}." for label, one in shares.items() if one.untracked or one.errors)
    if rows:
        heads = [tag_title(tag).replace(" ", "\n") for tag in TAGS]
        notes = {"loss": LOSS, **{tag_title(tag): words for tag, (words, _) in TAGS.items()}}
        print_tables(Table("Share of the losses that begin with", ("tracker",), ("count", *heads), rows, notes))


def print_recorded(results: Sequence[RecordedResult]) -> None:
    """Print the scores of each tracker on each sequence, over all seeds."""
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


def print_scored(found: Scored) -> None:
    """Print the overlap on each sequence, our measures over all, the benchmark's own, and comparisons in pairs."""
    print_warnings(found.misread)
    # Repetitions on one sequence are no independent results: a sequence counts once, by their mean.
    repetitions = grouped(found.results, lambda one: (one.sequence, one.tracker.label))
    means = {key: mean_summary([one.summary for one in own]) for key, own in repetitions.items()}
    sequences, trackers = (list(dict.fromkeys(key[place] for key in means)) for place in (0, 1))
    if len(sequences) <= _MOST_SEQUENCES:
        rows = [
            [name, *(number_text(means[name, one].mean_overlap) if (name, one) in means else "-" for one in trackers)]
            for name in sequences
        ]
        print_tables(Table("Mean overlap per sequence", ("sequence",), trackers, rows))
    groups = {("", one): [means[name, one] for name in sequences if (name, one) in means] for one in trackers}
    print_groups("frames with a known box", groups, unit="sequence")
    if (own := benchmark_table(found)) is not None:
        print_tables(own)
    if found.comparisons:
        rows = [
            [
                *(pair.first, pair.second, str(pair.difference.seeds)),
                *(range_text(pair.difference, sign="+"), p_text(pair.difference.p)),
            ]
            for pair in found.comparisons
        ]
        title = "Differences of mean overlap over sequences"
        print_tables(Table(title, ("first", "second"), ("sequences", "first - second", "p"), rows))
        print_lines([f"Below each difference: {INTERVALS}.", f"{VERDICTS}."])


def _print_slowest(results: Iterable[tuple[str, str, Summary]]) -> None:
    """Print the slowest frames of the slowest trackers and where they were."""
    slow = grouped((one for one in results if one[2].ms_max >= _SLOW_MS), lambda one: one[0])
    slowest = [max(own, key=lambda one: one[2].ms_max) for own in slow.values()]
    print_lines(
        f"slowest frame of {label}: {one.ms_max:.1f} ms, {where}, frame {one.ms_max_frame:.0f}"
        for label, where, one in sorted(slowest, key=lambda one: -one[2].ms_max)[:_MOST_SLOW]
    )


def print_groups(frames: str, groups: Mapping[tuple[str, str], Sequence[Summary]], unit: str = "seed") -> None:
    """Print means over seeds, or other units, by (place, tracker)."""
    print_tables(summaries(frames, groups, unit, wide=tables.console.width >= _WIDE))
    if max(map(len, groups.values()), default=0) > 1:
        print_lines([f"Below each overlap, a mean over {unit}s: {INTERVALS}."], wrap=True)


def print_next(run: RunStore) -> None:
    """Print what can be done with a run."""
    path, labels = shlex.quote(str(run.path)), run.plan.labels
    steps = [f"open {path}/report.html"]
    if len(labels) > 1:
        steps.append(f"pftrack-sim compare {path} --trackers {shlex.quote(f'{labels[-1]},{labels[0]}')}")
    if len({one.seed for one in run.results}) < LEAST_FOR_VERDICT:
        steps.append(f"the same command with {LEAST_FOR_VERDICT} or more --seeds, as verdicts need, adds them")
    print_lines(["next: " + "\n      ".join(steps)])


def print_tracebacks(run: RunStore) -> None:
    """Print each tracker's first error with its traceback and what it printed, and where its picture is."""
    for one, *_ in grouped((one for one in run.results if one.error), lambda one: one.label).values():
        picture = run.error_picture(one)
        if picture is not None:
            text = picture.with_suffix(".txt").read_text(encoding="utf-8")
            print_lines(["", text, f"picture of this frame, on {where(one)}: {picture}"])
