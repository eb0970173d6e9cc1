"""The compiled kernels of this installation: ``python -m assembly.kernels`` lists them and compiles them ahead."""
