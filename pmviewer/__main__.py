"""`python -m pmviewer`."""

from pmviewer.commands.cli import main

if __name__ == "__main__":
    main()
