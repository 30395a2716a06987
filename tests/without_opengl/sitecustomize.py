"""A machine without OpenGL: with this folder on PYTHONPATH its libraries cannot be found by whatever Python starts."""

import ctypes
from typing import Any

HIDDEN = ("libEGL", "libGL", "libOSMesa", "libOpenGL")


class Hiding(ctypes.CDLL):
    """As the loader is where nothing of OpenGL is installed."""

    def __init__(self, name: Any, *args: Any, **kwargs: Any) -> None:
        if name and any(word in str(name) for word in HIDDEN):
            raise OSError(f"{name}: cannot open shared object file: No such file or directory")
        super().__init__(name, *args, **kwargs)


ctypes.CDLL = Hiding
