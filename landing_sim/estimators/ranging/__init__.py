"""Range from motion: observers of a point's distance from its bearings and the known motion of the camera, one contract."""
