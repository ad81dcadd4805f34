"""`python -m tankcal` is the same as `tankcal`."""

import sys

from tankcal.cli import main

sys.exit(main())
