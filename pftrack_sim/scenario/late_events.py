"""What a scenario asks for at times when its episode has ended."""

from __future__ import annotations

from pftrack_sim.scenario.model import LightStep, ResolvedScenario


def late_events(settings: ResolvedScenario) -> list[str]:
    """What begins after the episode, so that it never happens: `"occluders.0 (walker) at 5 s"`."""
    times: list[tuple[str, float]] = [
        *((f"target.actions.{index} ({one.kind})", one.at_s) for index, one in enumerate(settings.target.actions)),
        *((f"occluders.{index} ({one.kind})", one.at_s) for index, one in enumerate(settings.occluders)),
    ]
    for index, change in enumerate(settings.lights.schedule):
        begins_s = change.at_s if isinstance(change, LightStep) else change.from_s
        times.append((f"lights.schedule.{index} ({change.kind})", begins_s))
    for name, axis in settings.axes:
        times += [(f"axes.{name}, event {number}", at_s) for number, at_s in enumerate(axis.events_s, start=1)]
    return [f"{title} at {time_s:.3g} s" for title, time_s in times if time_s >= settings.duration_s]


def axis_without_effect(settings: ResolvedScenario, name: str) -> str | None:
    """Why nothing of a stress axis is in the episode, or in the frames that are compared; None if something is."""
    axis = getattr(settings.axes, name)
    first_s, from_s = min(axis.events_s, default=0.0), axis.compared_from_s if axis.on else 0.0
    if max(first_s, from_s) < settings.duration_s:
        return None
    when = f"its first event begins at {first_s:g} s" if from_s < first_s else f"its first event ends at {from_s:g} s"
    key = next(key for key in ("end_s", "leave_at_s", "at_s") if hasattr(axis, key))
    return (
        f"axes.{name}: has no effect on what is compared: {when}, and the episode lasts {settings.duration_s:g} s; "
        f"set a longer duration_s, or an earlier axes.{name}.{key}"
    )
