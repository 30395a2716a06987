"""`python -m pftrack_sim`: the command line."""

import os
import sys

if __name__ == "__main__":
    # Python put the working folder first; the command line decides whether it belongs there.
    if sys.path[0] == os.getcwd():
        del sys.path[0]
    from pftrack_sim.cli import main

    main()
