"""One of many episodes whose frames are drawn together."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pftrack_sim.render.backend import Renderer
from pftrack_sim.scenario import Scenario
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.simulation.world import World

if TYPE_CHECKING:
    from pftrack_sim.render.warp.world_pool import WorldPool  # the extra `warp`


class PooledSimulation(Simulation):
    """A simulation with a place in a pool of worlds; `reset` and `advance` belong into tasks of `WorldPool.run`.

    Frames and truth are equal to the bit to those of `Simulation(scenario, backend="warp")`.
    """

    def __init__(self, scenario: Scenario, pool: WorldPool) -> None:
        super().__init__(scenario, backend="warp")
        self._pool = pool

    def _bind_renderer(self, world: World, size: tuple[int, int]) -> Renderer:
        renderer = self._renderer
        if renderer is not None and (renderer.width_px, renderer.height_px) == size:
            renderer.rebind(world.model)
            return renderer
        if renderer is not None:
            renderer.close()
        return self._pool.renderer(world.model, *size)
