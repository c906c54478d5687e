"""What is wrong with the streams of a recording, before any filter runs."""
