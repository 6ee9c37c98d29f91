"""The identifier for a car without a sensor of lateral velocity: it learns tires and tells v_y."""

from identifier.inertial.design import InertialIdentifier

__all__ = ["InertialIdentifier"]
