"""Navigation: the error-state filter that shows whether a configuration is honest.

``settings``   a `FilterConfig` as the states, drives and prior of a filter
``inputs``     inertial steps and satellite fixes on one clock
``filter``     the filter, readable, on filterpy: the reference
``engine``     the same filter compiled, for long drives and many runs
``simulate``   simulated flights of a sensor through a trajectory
"""
