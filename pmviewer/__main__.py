"""`python -m pmviewer`."""

from pmviewer.cli import main

if __name__ == "__main__":
    main()
