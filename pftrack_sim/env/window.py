"""A window for `render_mode="human"`, by pygame as Gymnasium's own environments do."""

from __future__ import annotations

import importlib
import os
from typing import Any

import numpy as np

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.records import Image


class Window:
    """Shows pictures at a frame rate; it opens with the first one.

    Raises:
        ParameterError: pygame or a display is missing.
    """

    def __init__(self, title: str, rate_hz: float) -> None:
        self._title, self._rate_hz = title, rate_hz
        self._screen: Any = None
        try:
            self._pygame: Any = importlib.import_module("pygame")
            self._pygame.display.init()
        except ImportError as error:
            raise _no_window(f"pip install 'pftrack-sim[human]' ({error})") from None
        except self._pygame.error as error:
            raise _no_window(f"there is no display ({error})") from None
        # Without a display SDL falls back to a driver that opens no window. Named in the environment, it was wanted.
        driver = self._pygame.display.get_driver()
        asked = os.environ.get("SDL_VIDEODRIVER") or os.environ.get("SDL_VIDEO_DRIVER")
        if driver in ("offscreen", "dummy") and driver != asked:
            self._pygame.display.quit()
            raise _no_window(f"there is no display (SDL has only its driver {driver!r})")
        self._clock = self._pygame.time.Clock()

    def show(self, picture: Image) -> None:
        """Show a `(H, W, 3)` uint8 RGB picture, and wait until the next one is due."""
        height, width = picture.shape[:2]
        if self._screen is None:
            self._screen = self._pygame.display.set_mode((width, height))
            self._pygame.display.set_caption(self._title)
        # pygame counts columns first.
        self._screen.blit(self._pygame.surfarray.make_surface(np.swapaxes(picture, 0, 1)), (0, 0))
        self._pygame.event.pump()
        self._pygame.display.flip()
        self._clock.tick(self._rate_hz)

    def close(self) -> None:
        """Close the window. Closing twice is fine."""
        self._screen = None
        self._pygame.display.quit()


def _no_window(reason: str) -> ParameterError:
    return ParameterError(
        f"render_mode='human' cannot open a window: {reason}. Without one, `pftrack-sim studio` shows an episode in "
        "the browser, and render_mode='rgb_array' returns pictures"
    )
