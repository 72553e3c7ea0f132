"""The renderer as a library: what `pmviewer.open` gives. Arrays come out, names and numbers go in."""
