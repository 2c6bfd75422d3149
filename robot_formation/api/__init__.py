"""What the package offers to Python programs; `import robot_formation as rf` gives all of it.

Lengths are metres, angles radians, times seconds. Displacements are (u, v): u to the right, v forward, in the robot's
own frame at the timestep's start; turns are anticlockwise.
"""
