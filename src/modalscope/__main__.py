"""`python -m modalscope` is the command line."""

import sys

from modalscope.interfaces.cli import main

if __name__ == "__main__":  # not when a process of its own is started from it
    sys.exit(main())
