"""`python -m prw` is the command `prw`."""

import sys

from prw.cli import main

sys.exit(main())
