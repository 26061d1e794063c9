"""``python -m mathnavi`` is the command line ``mathnavi``."""

import sys

from mathnavi.sim.commands.cli import main

sys.exit(main())
