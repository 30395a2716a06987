"""Who appears in an episode."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pftrack_sim.core.random_streams import stream
from pftrack_sim.scene.people.anatomy import sample_anatomy
from pftrack_sim.scene.people.body import Person
from pftrack_sim.scene.people.clothes import sample_outfit, similar_outfit


def sample_cast(
    seed: int,
    target_height_m: float,
    distractor_count: int,
    similarity: float,
    crosser_similarities: Sequence[float],
    passer_similarities: Sequence[float] = (),
) -> tuple[Person, ...]:
    """Target and everyone else, each from streams of their own: one more person changes nobody else.

    Args:
        seed: Root seed of the episode.
        target_height_m: Stature of the target.
        distractor_count: How many strangers walk about.
        similarity: Likeness of distractors to the target, in clothes and build: 1 for a twin.
        crosser_similarities: Likeness of each crosser to the target.
        passer_similarities: Likeness of each of those who pass close by the target.

    Returns:
        `target`, `distractor-1`.., `crosser-1`.., `passer-1`...

    Raises:
        ParameterError: A similarity is outside [0, 1], or the height is no adult's.
    """
    target = Person(
        "target",
        sample_anatomy(stream(seed, "anatomy", "target"), target_height_m),
        sample_outfit(stream(seed, "clothes", "target")),
    )
    others = [(f"distractor-{number + 1}", similarity) for number in range(distractor_count)]
    others += [(f"crosser-{number + 1}", likeness) for number, likeness in enumerate(crosser_similarities)]
    others += [(f"passer-{number + 1}", likeness) for number, likeness in enumerate(passer_similarities)]
    return (target, *(_stranger(seed, name, target, likeness) for name, likeness in others))


def _stranger(seed: int, name: str, target: Person, likeness: float) -> Person:
    outfit = similar_outfit(stream(seed, "clothes", name), target.outfit, likeness)
    if likeness == 1.0:
        return Person(name, target.anatomy, outfit)
    own = sample_anatomy(stream(seed, "anatomy", name))
    height = own.height_m + likeness * (target.anatomy.height_m - own.height_m)
    body = sample_anatomy(stream(seed, "anatomy", name), height)
    girth = own.girth + likeness * (target.anatomy.girth - own.girth)
    return Person(name, replace(body, girth=girth), outfit)
