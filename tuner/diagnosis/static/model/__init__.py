"""Noise and slow templates of a channel fitted together, its whitened residuals, and null distributions of tests."""
