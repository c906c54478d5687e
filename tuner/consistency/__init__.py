"""Is a filter as accurate as it says? Scores on simulated and measured data, error budget, observability."""
