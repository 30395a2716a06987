# MuJoCo's bindings are compiled without type information; for the type checker every name in them is `Any`.
from typing import Any

def __getattr__(name: str) -> Any: ...
