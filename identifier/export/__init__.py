"""From a method to what leaves this house: C for a microcontroller, FMU and ONNX for simulators."""
