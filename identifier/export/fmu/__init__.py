"""FMUs for Co-Simulation: a folded step as a component of a simulation."""

from identifier.export.fmu.package import export_fmu

__all__ = ["export_fmu"]
