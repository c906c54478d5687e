"""What a simulation of the fitted noise gets wrong, and why."""
