"""`python -m pftrack_sim`: the command line."""

from pftrack_sim.cli import main

if __name__ == "__main__":
    main()
