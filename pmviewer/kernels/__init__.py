"""Compiled device functions on arrays and scalars: vectors, random streams, warps, ray casting, BSDFs, lights."""
