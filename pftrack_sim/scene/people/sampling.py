"""Sampling of the people of an episode, with a given appearance similarity to the target."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pftrack_sim.core.random_streams import stream
from pftrack_sim.scene.people.anatomy import sample_anatomy
from pftrack_sim.scene.people.outfit import sample_outfit, similar_outfit
from pftrack_sim.scene.people.person import Person


def sample_people(
    seed: int,
    target_height_m: float,
    distractor_count: int,
    distractor_similarity: float,
    crosser_similarities: Sequence[float],
    passer_similarities: Sequence[float] = (),
) -> tuple[Person, ...]:
    """Sample the target and all other people; random streams are per person, so adding one changes no other.

    Args:
        seed: Root seed of the episode.
        target_height_m: Stature of the target [m].
        distractor_count: Number of pedestrians that walk about.
        distractor_similarity: Appearance similarity of distractors to the target, in clothes, height and girth, from 0
            to 1 (the same clothes and body).
        crosser_similarities: Similarity of each pedestrian that crosses the line of sight.
        passer_similarities: Similarity of each pedestrian that passes close by the target.

    Returns:
        `target`, `distractor-1`.., `crosser-1`.., `passer-1`...

    Raises:
        ParameterError: A similarity is outside [0, 1], or the height is not between 1.2 and 2.3 m.
    """
    target = Person(
        "target",
        sample_anatomy(stream(seed, "anatomy", "target"), target_height_m),
        sample_outfit(stream(seed, "clothes", "target")),
    )
    roles = {
        "distractor": [distractor_similarity] * distractor_count,
        "crosser": crosser_similarities,
        "passer": passer_similarities,
    }
    others = [
        _similar_person(seed, f"{role}-{number}", target, similarity)
        for role, similarities in roles.items()
        for number, similarity in enumerate(similarities, start=1)
    ]
    return (target, *others)


def _similar_person(seed: int, name: str, target: Person, similarity: float) -> Person:
    outfit = similar_outfit(stream(seed, "clothes", name), target.outfit, similarity)
    if similarity == 1.0:
        return Person(name, target.anatomy, outfit)
    independent = sample_anatomy(stream(seed, "anatomy", name))
    height = independent.height_m + similarity * (target.anatomy.height_m - independent.height_m)
    girth = independent.girth + similarity * (target.anatomy.girth - independent.girth)
    return Person(name, replace(sample_anatomy(stream(seed, "anatomy", name), height), girth=girth), outfit)
