"""A cheap case of each benchmark is computed again: where its number moved a record is false."""

import json
from dataclasses import replace
from importlib import import_module

import pytest

from benchmarks import paper_gains
from benchmarks.documents import records
from benchmarks.run_all import BENCHMARKS

WITHIN = 1e-3  # of a number: other processors and libraries change it by 1e-11, other methods more
RECORDED = {"recorded_cars"}  # needs recordings; all other cases are simulated


def agrees(canary, recorded):
    return json.loads(json.dumps(canary)) == pytest.approx(recorded, rel=WITHIN)


@pytest.mark.parametrize("script", BENCHMARKS)
def test_a_record_has_the_numbers_of_today(script, request):
    if script in RECORDED:
        request.getfixturevalue("shared_data")
    anew = f"record it anew: python -m benchmarks.run_all --record --only {script}"
    record = records()[script]
    assert "canary" in record, f"the record has no canary; {anew}"
    today = import_module(f"benchmarks.{script}").canary()
    assert agrees(today, record["canary"]), f"{today} is not {record['canary']}; {anew}"


def test_another_method_moves_its_canary(monkeypatch):
    recorded = paper_gains.canary()
    assert agrees(recorded, dict(recorded))
    learns_faster = replace(paper_gains.GAINS, eta_W=1.01 * paper_gains.GAINS.eta_W)
    monkeypatch.setattr(paper_gains, "GAINS", learns_faster)
    assert not agrees(paper_gains.canary(), recorded)
