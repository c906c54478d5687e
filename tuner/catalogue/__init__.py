"""Built-in grades of sensors and receivers, and built-in trajectories."""
