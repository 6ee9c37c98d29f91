"""The tracker that runs in real time: its C, and that C from Python."""

from mpc.problem import Guards
from mpc.realtime.instance import Command, Measurement, Status
from mpc.realtime.tracker import Tracker

__all__ = ["Command", "Guards", "Measurement", "Status", "Tracker"]
