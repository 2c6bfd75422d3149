"""Bags in and out: rosbag2 folders with MCAP files, without ROS."""
