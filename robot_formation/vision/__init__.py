"""From pictures to blocks: the Pixy2 in software, ArUco tags, and the overhead camera."""
