"""``python -m nichechain``."""

import sys

from nichechain.cli import main

sys.exit(main())
