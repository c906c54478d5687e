"""Linear-Gaussian model of a filter run: its likelihood under other noise and unknown constants, once for all rooms."""
