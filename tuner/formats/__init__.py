"""Documents and log files of the project: one file a stored kind, one codec for all of them."""
