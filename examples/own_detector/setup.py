"""An ament_python package, which pip installs too."""

from setuptools import setup

setup(
    name="own_detector",
    version="0.1.0",
    description="A detector node and a predictor for robot_formation, in a package of their own",
    license="Apache-2.0",
    packages=["own_detector"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/own_detector"]),
        ("share/own_detector", ["package.xml"]),
    ],
    install_requires=["numpy", "opencv-python-headless", "robot_formation"],
    entry_points={"console_scripts": ["detector = own_detector.node:main"]},
    zip_safe=False,
)
