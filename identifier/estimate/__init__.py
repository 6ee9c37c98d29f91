"""Tires, sensors and body from whole logs, by one estimate."""

from identifier.estimate.drive import Drive
from identifier.estimate.posterior import Posterior
from identifier.estimate.priors import Priors
from identifier.estimate.solve import estimate

__all__ = ["Drive", "Posterior", "Priors", "estimate"]
