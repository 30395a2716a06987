"""The command `pftrack-sim`."""

from __future__ import annotations

import os
import sys

from pftrack_sim.core.errors import PftrackError


def main() -> None:
    """Run the command line: a wrong input ends in one clear message and exit code 2, never in a traceback."""
    from pftrack_sim.cli.app import app

    # Trackers spelled `module:factory` may lie in the current folder; last, so that they hide nothing installed.
    sys.path.append(os.getcwd())
    try:
        app()
    except PftrackError as error:
        print(f"pftrack-sim: {error}", file=sys.stderr)  # noqa: T201 - this is the command line
        sys.exit(2)
