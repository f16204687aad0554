"""A predictor or a vessel as files for others: C99, FMI 2.0 (FMU), CasADi and ONNX."""
