"""rclpy adapters, one file per executable."""
