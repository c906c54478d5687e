"""The terms of inertial noise, one family a file; `models.noise` is the door to all of them."""
