"""Monocular keyframe SLAM for a camera that looks down: see `slam.Slam` and `front_end.SlamFrontEnd`."""
