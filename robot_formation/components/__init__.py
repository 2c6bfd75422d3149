"""The nodes' bodies at the level of messages, without rclpy."""
