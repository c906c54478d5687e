"""Which covariance each stream of a recording should have, for a filter without states for errors that last."""
