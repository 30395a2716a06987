"""Rooms from files, of each kind."""

from __future__ import annotations

from functools import lru_cache

from pftrack_sim.core.errors import ParameterError, ScenarioError
from pftrack_sim.scenario.model import MapPlace, MeshPlace, MjcfPlace
from pftrack_sim.scene.places.room import Room
from pftrack_sim.scene.places.room_map import read_map
from pftrack_sim.scene.places.room_mesh import read_mesh
from pftrack_sim.scene.places.room_mjcf import read_mjcf

_KINDS = {"map": MapPlace, "mjcf": MjcfPlace, "mesh": MeshPlace}


def load_room(place: MapPlace | MjcfPlace | MeshPlace) -> Room:
    """The room of a file, read once as long as its digest stays the same.

    Raises:
        ScenarioError: The file cannot be read, or is no room for people and robot.
    """
    return _read(place.kind, place.model_dump_json())


@lru_cache(maxsize=4)
def _read(kind: str, values: str) -> Room:
    place = _KINDS[kind].model_validate_json(values)
    try:
        match place:
            case MapPlace():
                return read_map(place)
            case MjcfPlace():
                return read_mjcf(place)
            case MeshPlace():
                return read_mesh(place)
    except ParameterError as error:
        raise ScenarioError(place.model, [f"place.model: {error}"]) from None
