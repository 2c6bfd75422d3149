"""An rclpy node around a component: parameters, messages out, signals, help."""
