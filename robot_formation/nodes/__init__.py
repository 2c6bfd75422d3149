"""The executables, and the rclpy adapters behind them."""
