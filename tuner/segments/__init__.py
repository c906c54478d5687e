"""Parts of a log: at rest, without error codes, at one temperature, in several positions; calibration from these."""
