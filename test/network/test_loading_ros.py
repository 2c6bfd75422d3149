"""What is loaded with ROS, and what is not."""

import subprocess
import sys

LOADED = """
import sys
from robot_formation import conversions
conversions.to_time(1)
from std_msgs.msg import String
String.__class__.__import_type_support__()
print(String.__class__._TYPE_SUPPORT is not None, "lark" in sys.modules)
import rosidl_generator_py.generate_py_impl
print("lark" in sys.modules)
"""


def test_messages_are_loaded_without_the_generator_of_their_code_which_can_still_be_imported() -> None:
    done = subprocess.run([sys.executable, "-c", LOADED], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["True", "False", "True"]
