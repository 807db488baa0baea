"""`python -m vnca` is the same as `vnca`."""

import sys

from vnca.cli import main

if __name__ == "__main__":
    sys.exit(main())
