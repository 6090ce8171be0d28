"""``python -m segar`` is the command ``segar``."""

import sys

from segar.cli import main

sys.exit(main())
