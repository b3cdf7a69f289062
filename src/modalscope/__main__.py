"""`python -m modalscope` is the command line."""

import sys

from modalscope.cli import main

sys.exit(main())
