"""The bounding volume hierarchy and casting rays through it: triangles, quadrics, instances, holes."""
