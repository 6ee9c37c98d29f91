"""The benchmark of broken sensors counts what it should, of drives that a user can ask for."""

import pytest

from benchmarks.mpc_cases import options_of
from benchmarks.mpc_sensor_faults import (
    CAUTIOUS,
    DRIVERS,
    FAULTS,
    Outcome,
    Row,
    cases_of,
    fault_word,
    judge,
)
from benchmarks.targets import Targets
from models.faults import KINDS
from mpc.loop.sensing import Measured
from tireid.commands.drive_case import conditions_of, parse_fault
from tireid.driving.runs import FROZEN, LEARNING

KEPT, LEFT = Outcome(True, 0.1, (), 20.0), Outcome(False, 2.0, (), 12.0)


def row(learning, frozen, cautious=(KEPT, KEPT), begins=(3.0, 9.0)):
    outcomes = {LEARNING: learning, FROZEN: frozen, CAUTIOUS: list(cautious)}
    return Row("r", "r stuck", begins, outcomes)


def test_there_are_34_faults_of_every_channel_and_kind():
    assert len(set(FAULTS)) == len(FAULTS) == 34
    assert {channel for channel, *_ in FAULTS} == set(Measured._fields[1:])
    assert {kind for _, kind, *_ in FAULTS} == set(KINDS)


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_is_what_the_command_is_told(fault):
    told = parse_fault(fault_word(fault, 9.0))
    assert (told.channel, told.kind, told.duration, told.size) == fault and told.start == 9.0


@pytest.mark.heavy
@pytest.mark.parametrize("driver", DRIVERS)
def test_every_drive_is_one_of_the_command_and_goes_on_after_its_fault_began(driver):
    cases = cases_of(FAULTS[0], driver)
    assert len(set(cases)) == len(cases) == 6
    for case in cases:
        conditions = conditions_of(options_of(case.words))
        (fault,) = conditions.faults
        setup = conditions.setup
        assert fault.start == case.begins
        assert case.begins < 0.8 * setup.time_at(setup.path.length * conditions.laps)


def test_only_what_learning_alone_loses_counts_as_worse():
    assert row([KEPT, LEFT], [KEPT, KEPT]).worse(LEARNING) == 1
    assert row([KEPT, LEFT], [LEFT, LEFT]).worse(LEARNING) == 0
    assert row([KEPT, LEFT], [KEPT, KEPT]).left(LEARNING) == 1


def test_the_first_alarm_after_the_fault_is_its_detection_and_one_before_it_is_false(capsys):
    early = Outcome(True, 0.1, (2.0, 3.25, 5.0), 20.0)
    rows = [row([early, KEPT], [KEPT, KEPT])]
    assert rows[0].times == [0.25]
    for quiet, alarms in (([KEPT], 1), ([KEPT, early], 4)):
        targets = Targets("mpc_sensor_faults")
        judge(rows, quiet, targets)
        assert targets.values["quiet/alarms"] == alarms
        assert targets.finish(keep=False) == 1
    assert targets.values["r/noticed"] == 1 and targets.values["worse"] == 0


def test_caution_may_neither_leave_the_path_nor_go_far_off_where_frozen_tires_do_not():
    near, far = KEPT._replace(peak=0.5), KEPT._replace(peak=0.51)
    for cautious, frozen, worse in (
        (LEFT, KEPT, 1),
        (LEFT, far, 1),
        (far, near, 1),
        (near, KEPT, 0),
        (far, far, 0),
        (LEFT, LEFT, 0),
        (KEPT, LEFT, 0),
    ):
        targets = Targets("mpc_sensor_faults")
        judge([row([KEPT, KEPT], [KEPT, frozen], [KEPT, cautious])], [KEPT], targets)
        assert targets.values["worse_cautious"] == targets.values["r/worse_cautious"] == worse
        assert targets.finish(keep=False) == worse
