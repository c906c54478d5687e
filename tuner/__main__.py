"""`python -m tuner` is the command line."""

from __future__ import annotations

from tuner.cli import main

if __name__ == "__main__":
    main()
