"""The tracker that runs in real time: its C, and that C from Python."""

from mpc.realtime.guards import Guards
from mpc.realtime.instance import NoCompilerError
from mpc.realtime.messages import Command, Measurement, Status
from mpc.realtime.tracker import Tracker

__all__ = ["Command", "Guards", "Measurement", "NoCompilerError", "Status", "Tracker"]
