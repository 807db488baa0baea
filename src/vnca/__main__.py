"""`python -m vnca` is the same as `vnca`."""

import sys

from vnca.cli import main

sys.exit(main())
