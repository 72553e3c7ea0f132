"""Pictures that are shown before there is an estimate of the same size."""
