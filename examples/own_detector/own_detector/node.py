"""The detector as a ROS node that takes the place of robot_formation's block_detector."""

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile
from sensor_msgs.msg import Image, PointCloud2

from own_detector.detector import find_faces
from robot_formation import conversions
from robot_formation.vision.pixy2.block import Block

# Reliable, and nothing is dropped: docs/reference/nodes/common.md calls it "event".
EVENT = QoSProfile(history=HistoryPolicy.KEEP_ALL)


class OwnDetector(Node):
    """Answers each picture on camera/image_raw with the faces in it, on blocks."""

    def __init__(self):
        super().__init__("block_detector")
        # The run's parameter file names its recorder; not every run has one.
        recorder = self.declare_parameter("recorder", "").value
        self.listeners = {"fine_tuner"} | ({recorder.rpartition("/")[2]} if recorder else set())
        self.publisher = self.create_publisher(PointCloud2, "blocks", EVENT)
        # Pictures come as soon as they are subscribed to. Before that the answers must have found their listeners, or
        # the first ones get lost.
        self.timer = self.create_timer(0.1, self.subscribe)

    def subscribe(self):
        known = [info.node_name for info in self.get_subscriptions_info_by_topic(self.publisher.topic_name)]
        if self.listeners <= set(known) and self.publisher.get_subscription_count() == len(known):
            self.timer.cancel()
            self.create_subscription(Image, "camera/image_raw", self.on_picture, EVENT)
            self.get_logger().info("ready")

    def on_picture(self, message):
        faces = find_faces(conversions.read_image(message))
        blocks = [Block(*face) for face in faces]
        # A picture without faces has an answer too, and each answer has its picture's frame and stamp.
        self.publisher.publish(conversions.blocks(blocks, message.header.frame_id, conversions.stamp_of(message)))


def main():
    rclpy.init()
    node = OwnDetector()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass  # Ctrl-C, or a signal to end
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
