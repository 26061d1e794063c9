"""``python -m mathnavi`` is the command line ``mathnavi``."""

import os
import sys

if not sys.flags.safe_path and sys.path[:1] == [os.getcwd()]:
    del sys.path[0]  # so that no numpy.py of the current folder is taken for the library; plug-ins are found there last

from mathnavi.commands.cli import main

sys.exit(main())
