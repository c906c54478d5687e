"""One file a command: it reads, calls the rooms in order, and writes."""
