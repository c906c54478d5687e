"""Parts of a log: at rest, at one temperature, in several positions; calibration from these."""
