"""The tracker as a C package, alone and together with the identifier."""
