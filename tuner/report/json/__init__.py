"""Machine-readable views of results."""
