"""Linear model of a filter run: how errors of sensors and fixes propagate to the innovations, and their likelihood."""
