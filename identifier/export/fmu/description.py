"""modelDescription.xml of FMI 2.0 and 3.0, and the list of sources for whoever builds it again."""

from collections.abc import Sequence

from identifier.export.fmu.variables import DEGREES, UNITS, Variable, variables
from identifier.export.fmu.xml_text import DECLARATION, element
from identifier.export.fold import FoldedStep

TOOL = "tireid"


def description_2(folded: FoldedStep, token: str, sources: Sequence[str]) -> str:
    """Return modelDescription.xml of FMI 2.0.

    Parameters
    ----------
    folded : the step.
    token : the GUID.
    sources : names of the C files.
    """
    table = variables(folded)
    unknowns = [
        element("Unknown", {"index": i})
        for i, variable in enumerate(table, start=1)
        if variable.causality == "output"
    ]
    model = element(
        "fmiModelDescription",
        {
            "fmiVersion": "2.0",
            "modelName": folded.name,
            "guid": token,
            "description": _sentence(folded),
            "generationTool": TOOL,
            "variableNamingConvention": "flat",
        },
        element(
            "CoSimulation",
            {
                "modelIdentifier": folded.name,
                "canHandleVariableCommunicationStepSize": True,
                "canNotUseMemoryManagementFunctions": True,
                "canGetAndSetFMUstate": True,
                "canSerializeFMUstate": True,
            },
            element("SourceFiles", {}, *(element("File", {"name": name}) for name in sources)),
        ),
        _units(),
        _experiment(folded),
        element("ModelVariables", {}, *(_variable_2(variable) for variable in table)),
        element(
            "ModelStructure",
            {},
            element("Outputs", {}, *unknowns),
            element("InitialUnknowns", {}, *unknowns),
        ),
    )
    return f"{DECLARATION}{model}\n"


def description_3(folded: FoldedStep, token: str) -> str:
    """Return modelDescription.xml of FMI 3.0.

    Parameters
    ----------
    folded : the step.
    token : the instantiation token.
    """
    table = variables(folded)
    outputs = [variable for variable in table if variable.causality == "output"]
    time = element(
        "Float64",
        {"name": "time", "valueReference": 0, "causality": "independent", "unit": "s"}
        | {"variability": "continuous", "description": "simulation time"},
    )
    model = element(
        "fmiModelDescription",
        {
            "fmiVersion": "3.0",
            "modelName": folded.name,
            "instantiationToken": token,
            "description": _sentence(folded),
            "generationTool": TOOL,
            "variableNamingConvention": "flat",
        },
        element(
            "CoSimulation",
            {
                "modelIdentifier": folded.name,
                "canGetAndSetFMUState": True,
                "canSerializeFMUState": True,
                "canHandleVariableCommunicationStepSize": True,
            },
        ),
        _units(),
        _experiment(folded),
        element("ModelVariables", {}, time, *(_variable_3(variable) for variable in table)),
        element(
            "ModelStructure",
            {},
            *(
                element(tag, {"valueReference": variable.reference})
                for tag in ("Output", "InitialUnknown")
                for variable in outputs
            ),
        ),
    )
    return f"{DECLARATION}{model}\n"


def build_description(folded: FoldedStep, sources: Sequence[str]) -> str:
    """Return sources/buildDescription.xml of FMI 3.0.

    Parameters
    ----------
    folded : the step.
    sources : names of the C files.
    """
    files = (element("SourceFile", {"name": name}) for name in sources)
    text = element(
        "fmiBuildDescription",
        {"fmiVersion": "3.0"},
        element(
            "BuildConfiguration",
            {"modelIdentifier": folded.name},
            element("SourceFileSet", {"language": "C99"}, *files),
        ),
    )
    return f"{DECLARATION}{text}\n"


def _sentence(folded: FoldedStep) -> str:
    return (
        f"Lateral tire forces of a car, identified while it drives, every {folded.dt:g} s. Outputs "
        "are those of the last sample; slip angles inside have the sign in which F_y = +C alpha."
    )


def _units() -> str:
    angle = {"rad": ("deg", DEGREES), "rad/s": ("deg/s", DEGREES)}
    units = []
    for name, base in UNITS.items():
        children = [element("BaseUnit", dict(base))]
        if name in angle:
            shown, factor = angle[name]
            children.append(element("DisplayUnit", {"name": shown, "factor": factor}))
        units.append(element("Unit", {"name": name}, *children))
    return element("UnitDefinitions", {}, *units)


def _experiment(folded: FoldedStep) -> str:
    return element("DefaultExperiment", {"startTime": 0.0, "stopTime": 10.0, "stepSize": folded.dt})


def _variable_2(variable: Variable) -> str:
    tag = {"real": "Real", "integer": "Integer", "boolean": "Boolean"}[variable.kind]
    return element(
        "ScalarVariable",
        {
            "name": variable.name,
            "valueReference": variable.reference,
            "description": variable.description,
            "causality": variable.causality,
            "variability": variable.variability,
            "initial": _initial(variable),
        },
        element(tag, {"unit": variable.unit, "start": variable.start}),
    )


def _variable_3(variable: Variable) -> str:
    tag = {"real": "Float64", "integer": "Int32", "boolean": "Boolean"}[variable.kind]
    return element(
        tag,
        {
            "name": variable.name,
            "valueReference": variable.reference,
            "description": variable.description,
            "causality": variable.causality,
            "variability": variable.variability,
            "initial": _initial(variable),
            "unit": variable.unit,
            "start": variable.start,
        },
    )


def _initial(variable: Variable) -> str:
    """Return what the standard wants to be said of an initial value; of an input, nothing."""
    if variable.causality == "input":
        return ""
    return "exact" if variable.start else "calculated"
