"""Settings of small episodes, a name with markup and a script, and how to wait for a page."""

from typing import Any

HOSTILE = '<script>document.title = "taken"</script><img src=x onerror="document.title=\'taken\'">'

SMALL = {"duration_s": 0.8, "camera.width_px": 96, "camera.height_px": 72, "lights.shadows": False, "occluders": []}


def until(page: Any, expression: str) -> None:
    """Wait for an expression to be true; playwright's own way is evaluated in the page, whose policy forbids that."""
    for _ in range(600):
        if page.evaluate(expression):
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"never true: {expression}")
