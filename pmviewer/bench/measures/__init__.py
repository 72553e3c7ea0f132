"""One measure a file: what `pmviewer bench NAME` runs, prints and holds against its targets."""
