"""Passes rendered by other processes and machines, by Dask."""
