"""`python -m stereoforge` is the `stereoforge` command."""

from stereoforge.cli import main

if __name__ == "__main__":
    main()
