"""Series of pictures: settings between keys, one picture for each."""
