"""What accuracy costs in time: methods, kernels and precisions, timed here and now."""
