"""`python -m airrace`: the command line."""

from airrace.cli.main import main

if __name__ == "__main__":
    main()
