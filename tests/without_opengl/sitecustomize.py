"""Simulates a machine without OpenGL: with this folder on PYTHONPATH, Python cannot load its libraries."""

import ctypes
from typing import Any

HIDDEN = ("libEGL", "libGL", "libOSMesa", "libOpenGL")


class HidingCDLL(ctypes.CDLL):
    """Loads any library but those of OpenGL."""

    def __init__(self, name: Any, *args: Any, **kwargs: Any) -> None:
        if name and any(word in str(name) for word in HIDDEN):
            raise OSError(f"{name}: cannot open shared object file: No such file or directory")
        super().__init__(name, *args, **kwargs)


ctypes.CDLL = ctypes.cdll._dlltype = HidingCDLL
