"""`python -m lightfield`: the program."""

import sys

from lightfield.cli import main

if __name__ == "__main__":
    sys.exit(main())
