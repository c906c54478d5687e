"""Trajectories in closed form, with the exact measurements of an inertial unit and a receiver along them."""
