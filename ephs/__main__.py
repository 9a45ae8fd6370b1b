"""Run the command line as ``python -m ephs``."""

import sys

from ephs.cli import main

if __name__ == "__main__":
    sys.exit(main())
