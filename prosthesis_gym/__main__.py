"""`python -m prosthesis_gym`: the same as the command `prosthesis-gym`."""

import sys

from prosthesis_gym.cli import main

if __name__ == "__main__":
    sys.exit(main())
