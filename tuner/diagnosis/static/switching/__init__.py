"""Switching models: a bias that jumps between levels beside slow noise; likelihood by a bank of Kalman filters."""
