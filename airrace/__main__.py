"""The command line, run as `python -m airrace`."""

from airrace.cli.main import main

if __name__ == "__main__":
    main()
