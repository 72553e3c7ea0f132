"""The same picture made in two ways at once, to see what one of them buys."""
