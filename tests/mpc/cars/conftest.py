"""Driving a car open loop, and a signal of what it did."""

import numpy as np


def driven(car, periods, command, v_x=20.0):
    states = [car.start(v_x)]
    for k in range(periods):
        states.append(car.step(states[-1], command(k), v_x))
    return states


def column(states, name):
    return np.array([getattr(state, name) for state in states])
