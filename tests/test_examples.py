"""Every example runs and says what it promises."""

import importlib.util
import json
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

import tireid as ti

ROOT = Path(__file__).resolve().parents[1]
NODE = ROOT / "examples" / "ros2_node.py"  # needs ROS 2, or what stands in for it below
EXAMPLES = sorted({*(ROOT / "examples").glob("*.py")} - {NODE})


def loaded(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.sweep("learn_and_freeze", "derivations")
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs_and_stays_short(path, tmp_path, monkeypatch, capsys):
    if path.stem == "own_network":
        pytest.importorskip("onnx", reason="needs the package onnx")
    monkeypatch.chdir(tmp_path)
    assert len(path.read_text().splitlines()) <= 80
    module = loaded(path)
    headline = module.main()
    assert isinstance(headline, float)
    assert 0.0 < headline < module.EXPECTED_BELOW
    assert capsys.readouterr().out


class Ros:
    """Stands in for rclpy: a node whose topics are lists, and messages that are what they get.

    play : what `spin` does: messages by topic, in the order in which they come.
    """

    def __init__(self, play, **parameters):
        self.play, self.parameters, self.subscribed, self.published = play, parameters, {}, {}

    def create_node(self, name):
        return self

    def declare_parameter(self, name, default):
        return SimpleNamespace(value=self.parameters.get(name, default))

    def create_publisher(self, kind, topic, qos):
        sent = self.published.setdefault(topic, [])
        return SimpleNamespace(publish=lambda message: sent.append(message))

    def create_subscription(self, kind, topic, callback, qos):
        self.subscribed[topic] = callback

    def spin(self, node):
        for topic, message in self.play:
            self.subscribed[topic](message)

    def put_in(self, monkeypatch):
        class Status(SimpleNamespace):
            OK, WARN = b"\x00", b"\x01"

        modules = {
            "rclpy": {"init": lambda: None, "create_node": self.create_node, "spin": self.spin},
            "rclpy.qos": {"qos_profile_sensor_data": 10},
            "nav_msgs.msg": {"Odometry": SimpleNamespace},
            "ackermann_msgs.msg": {"AckermannDriveStamped": SimpleNamespace},
            "std_msgs.msg": {"String": SimpleNamespace},
            "diagnostic_msgs.msg": {"DiagnosticArray": SimpleNamespace, "DiagnosticStatus": Status},
        }
        for name in (*{name.split(".")[0] for name in modules}, *modules):
            module = ModuleType(name)
            vars(module).update(modules.get(name, {}))
            monkeypatch.setitem(sys.modules, name, module)


def stamp_of(t):
    return SimpleNamespace(sec=int(t), nanosec=round(1e9 * (t % 1.0)))


def messages_of(log):
    """Steering and odometry of a log as a robot would publish them."""
    samples = zip(log.t, log.v_x, log.v_y, log.r, log.delta_f, strict=True)
    for t, v_x, v_y, r, angle in samples:
        twist = SimpleNamespace(linear=SimpleNamespace(x=v_x, y=v_y), angular=SimpleNamespace(z=r))
        yield "steering", SimpleNamespace(drive=SimpleNamespace(steering_angle=angle))
        head, twist = SimpleNamespace(stamp=stamp_of(t)), SimpleNamespace(twist=twist)
        yield "odom", SimpleNamespace(header=head, twist=twist)


def test_the_node_of_ros_publishes_what_live_says_of_its_topics(monkeypatch, tmp_path):
    assert len(NODE.read_text().splitlines()) <= 55
    car, log = ti.sedan(), ti.sample_recording().between(0.0, 5.0)
    car.to_toml(tmp_path / "car.toml")
    ros = Ros(messages_of(log), vehicle=str(tmp_path / "car.toml"), velocity_sensor_x=-1.2)
    ros.put_in(monkeypatch)
    loaded(NODE).main()
    live = ti.Live(car)
    stamps = (stamp_of(t) for t in log.t)
    times = [stamp.sec + 1e-9 * stamp.nanosec for stamp in stamps]
    signals = zip(times, log.v_x, log.r, log.delta_f, log.v_y, strict=True)
    fed = [live.feed(t, v_x, r, angle, v_y=v_y + 1.2 * r) for t, v_x, r, angle, v_y in signals]
    states = [json.loads(message.data) for message in ros.published["tireid/state"]]
    assert states == [state.to_dict() for state in fed if state is not None]
    diagnoses = [status for one in ros.published["/diagnostics"] for status in one.status]
    assert len(diagnoses) == len(states) > 20
    assert {one.level for one in diagnoses} == {b"\x00"} and all(one.message for one in diagnoses)
