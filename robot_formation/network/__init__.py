"""ROS domains, sockets on this machine only, and the shared memory that Fast DDS needs."""
