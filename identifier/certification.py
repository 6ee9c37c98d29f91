"""What is proven of a method for a car: the certificate of its gains, or the boxes that it keeps.

The paper's laws have margins and bounds that follow from their gains. The default method has
none: what it learns stays inside boxes whatever is measured. Of the others nothing is proven.
"""

from identifier.axle.design import AxleDesign
from identifier.defaults import natural_operation
from identifier.method import Method
from identifier.paper.design import Design, Driving
from identifier.paper.laws import DRIVING_ERRORS
from identifier.stability import Certificate
from identifier.stability import certify as certify_gains
from models.vehicle import Vehicle


def certify(method: Method, vehicle: Vehicle, driving: Driving | None = None) -> Certificate:
    """Return what is proven of a method.

    Parameters
    ----------
    method : any method.
    vehicle : the car.
    driving : how hard it is driven; None takes what is stored in a design, else `natural_driving`.
    """
    match method:
        case Design():
            operation = natural_operation(method, vehicle, driving)
            return certify_gains(method.gains, DRIVING_ERRORS[method.law], operation)
        case AxleDesign():
            return Certificate(held=method.certificate["held_by_construction"])
        case _:
            return Certificate()
