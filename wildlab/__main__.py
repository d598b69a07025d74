"""``python -m wildlab``: the command line."""

from wildlab.cli import main

if __name__ == "__main__":
    main()
