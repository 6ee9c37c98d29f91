"""Handing weights over while driving: when a learnt tire is fit to steer with, and how gently."""

from mpc.handover.judge import ChiSquare, ErrorModel, Judge
from mpc.handover.learner import Learner
from mpc.handover.rules import Decision, Rules, Verdict
from mpc.handover.supervisor import Supervisor

__all__ = [
    "ChiSquare",
    "Decision",
    "ErrorModel",
    "Judge",
    "Learner",
    "Rules",
    "Supervisor",
    "Verdict",
]
