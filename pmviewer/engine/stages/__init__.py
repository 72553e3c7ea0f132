"""One stage a file: from the scene, some settings and earlier results to the next results of a pass."""
