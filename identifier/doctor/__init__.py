"""The doctor: what is wrong with a log, or with the declaration of its car, from the log alone."""

from identifier.doctor.diagnosis import Diagnosis, diagnose
from identifier.doctor.faults import Examination, examine
from identifier.doctor.finding import Finding

__all__ = ["Diagnosis", "Examination", "Finding", "diagnose", "examine"]
