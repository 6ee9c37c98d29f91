"""A node of ROS 2: odometry and steering in, the tires and an alarm out, by `ti.Live`.

    python3 ros2_node.py --ros-args -p vehicle:=car.toml -r odom:=/ekf/odom -r steering:=/ackermann

`-p velocity_sensor_x:=-1.2`: odometry is of a point 1.2 m behind the center of gravity.
rclpy comes with ROS 2 and not from PyPI: this file is tested with a stand-in of it, in no robot.
"""

import json
import math

import rclpy
from ackermann_msgs.msg import AckermannDriveStamped
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import Odometry
from rclpy.qos import qos_profile_sensor_data
from std_msgs.msg import String

import tireid as ti


def main() -> None:
    rclpy.init()
    node = rclpy.create_node("tireid")
    live = ti.Live(ti.Vehicle.from_toml(node.declare_parameter("vehicle", "car.toml").value))
    live.prepare(v_y=True)  # compiles, once
    ahead = node.declare_parameter("velocity_sensor_x", 0.0).value  # m, of the center of gravity
    states = node.create_publisher(String, "tireid/state", 10)
    diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
    steering = math.nan  # rad, at the road wheels, left positive

    def steered(message: AckermannDriveStamped) -> None:
        nonlocal steering
        steering = message.drive.steering_angle

    def moved(message: Odometry) -> None:
        stamp, twist = message.header.stamp, message.twist.twist
        t, v, r = stamp.sec + 1e-9 * stamp.nanosec, twist.linear, twist.angular.z
        state = live.feed(t, v.x, r, steering, v_y=v.y - ahead * r)
        if state is None:
            return
        states.publish(String(data=json.dumps(state.to_dict())))
        level = DiagnosticStatus.WARN if state.alarm else DiagnosticStatus.OK
        text = state.alarm or state.reason or "tires are known"
        status = DiagnosticStatus(level=level, name="tireid", message=text)
        diagnostics.publish(DiagnosticArray(header=message.header, status=[status]))

    node.create_subscription(AckermannDriveStamped, "steering", steered, qos_profile_sensor_data)
    node.create_subscription(Odometry, "odom", moved, qos_profile_sensor_data)
    rclpy.spin(node)


if __name__ == "__main__":
    main()
