"""Logs of messages (PX4 ULog, ArduPilot, ROS bags): streams of inertial samples and fixes, found by message type."""
