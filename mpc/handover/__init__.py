"""Handing weights over while driving: when a learnt tire is fit to steer with, and how gently."""

from mpc.handover.judge import ErrorModel, Judge, Misfit
from mpc.handover.learner import Learner
from mpc.handover.rules import Decision, Rules, Verdict
from mpc.handover.supervisor import Supervisor

__all__ = [
    "Decision",
    "ErrorModel",
    "Judge",
    "Learner",
    "Misfit",
    "Rules",
    "Supervisor",
    "Verdict",
]
