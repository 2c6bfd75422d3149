# The package in a ROS 2 Jazzy workspace, built as docs/how-to/installation.md says.
# What the package needs, without the package: .devcontainer/ puts the checkout here instead.
FROM ros:jazzy AS dependencies
SHELL ["/bin/bash", "-o", "pipefail", "-c"]
WORKDIR /workspace
ENV PIP_BREAK_SYSTEM_PACKAGES=1
# NumPy comes first: PyBullet has fast cameras only if it finds it while it is compiled. Versions are those of the image's
# Ubuntu, and PyBullet's newest, as a workspace gets them.
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install -y --no-install-recommends g++ python3-dev python3-numpy python3-pip python3-setuptools python3-wheel \
    && rm -rf /var/lib/apt/lists/*
# hadolint ignore=DL3013
RUN pip3 install --no-cache-dir --no-build-isolation pybullet
COPY package.xml src/robot_formation/
RUN apt-get update \
    && rosdep update --rosdistro jazzy \
    && rosdep install -y --from-paths src --ignore-src \
    && rm -rf /var/lib/apt/lists/*

FROM dependencies
COPY . src/robot_formation
RUN . /opt/ros/jazzy/setup.sh && colcon build --packages-select robot_formation
ENTRYPOINT ["/bin/bash", "-c", "source /workspace/install/setup.bash && exec \"$@\"", "--"]
CMD ["bash"]
