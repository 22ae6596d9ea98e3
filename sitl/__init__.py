"""The vehicle we do not have: JSBSim physics, a PX4-style flight stack, LiDAR, MAVLink."""
