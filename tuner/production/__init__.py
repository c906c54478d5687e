"""Many units of one sensor: which keep their limits, which stand apart, and how far units differ."""
