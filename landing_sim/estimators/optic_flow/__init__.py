"""Ventral and expansion optic flow and pitch from three fixed motion sensors, without inertial unit: one contract."""
